"""The `appocc` command: one thin file a command, no logic of its own."""
