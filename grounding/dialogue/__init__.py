"""A conversation: sentences that answer or correct what was said before, and plans that follow the scene."""
