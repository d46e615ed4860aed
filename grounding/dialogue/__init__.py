"""A conversation: sentences that answer, correct or continue what was said before, and plans that follow the scene."""
