"""Images for people: maps, rigs, predictions and contact sheets."""
