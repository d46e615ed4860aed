"""Goal selection: the cell where the ego's footprint fulfils a command."""
