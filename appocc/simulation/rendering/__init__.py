"""Rendering of a town with its actors in a weather: camera images, LiDAR sweeps and bird's-eye views."""
