"""Training: packed data, losses, a loop that one reads from top to bottom, run folders."""
