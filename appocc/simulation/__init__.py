"""The embedded simulator: towns with traffic, cameras, LiDAR and exact ground truth in the nuScenes schema."""

from pathlib import Path

from appocc.environment import choose_cache_folders

# All modules with numba kernels are below this one.
choose_cache_folders(Path(__file__).parent)
