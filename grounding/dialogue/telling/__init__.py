"""What the car tells: answers to questions, reports of the goal and of what is seen, and their phrases."""
