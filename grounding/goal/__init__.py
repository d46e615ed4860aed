"""Goal selection: the goal pose at which the ego footprint fulfils a command, and the route to it."""
