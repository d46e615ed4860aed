"""Tagging: the category of each token in context."""
