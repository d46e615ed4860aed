"""Networks that predict bird's-eye-view occupancy and appearance from surround images."""
