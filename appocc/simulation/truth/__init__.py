"""What is true of a moment: layers from above, boxes, what is visible, depth and class of every pixel."""
