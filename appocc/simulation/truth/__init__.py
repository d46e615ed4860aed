"""Exact ground truth of a frame: BEV layers, boxes, visibility, depth and class of every pixel."""
