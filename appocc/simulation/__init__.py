"""The embedded simulator: towns with traffic, cameras, LiDAR and exact truth, written in the nuScenes schema."""
