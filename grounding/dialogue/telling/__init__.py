"""Answers in words: to questions, reports of the goal and of the scene, and their phrases."""
