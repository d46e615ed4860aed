"""Commands in simulated scenes with their true vehicle and places, made without any code of `grounding`."""
