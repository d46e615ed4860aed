"""Generated commands in simulated scenes, with referent and goal region; without any code of `grounding`."""
