"""State estimation: Kalman filters, and offline smoothing."""
