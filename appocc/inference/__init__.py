"""Inference: from images of recordings or folders to predicted maps."""
