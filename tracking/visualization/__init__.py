"""Video of tracks."""
