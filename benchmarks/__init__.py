"""What is timed and measured: each module is one command."""
