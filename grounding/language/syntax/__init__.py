"""Syntax of a command: words and their categories, noun phrases and clauses."""
