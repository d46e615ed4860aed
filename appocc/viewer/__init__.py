"""Recordings for viewers: a scene with cameras, boxes, maps, tracks and a goal as Rerun and MCAP files."""
