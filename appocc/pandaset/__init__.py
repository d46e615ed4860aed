"""PandaSet recordings to the nuScenes schema."""
