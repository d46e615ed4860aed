"""Vehicle instances of bird's-eye-view maps."""
