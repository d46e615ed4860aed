"""Vehicle instances from bird's-eye-view maps."""
