"""Language: from the words of a command to a typed query."""
