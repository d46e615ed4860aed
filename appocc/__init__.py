"""The core of appocc: geometry, colour bird's-eye views, data in the nuScenes schema."""

__version__ = "0.1.0"
