"""State estimation: Kalman filters, running medians, and offline smoothing."""
