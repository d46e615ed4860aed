"""The `appocc` command: one thin module per sub-command."""
