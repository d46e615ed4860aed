"""Generation of towns and their traffic from a seed, an OpenDRIVE map or a SUMO network; needs the extra `sumo`."""
