"""Reader: a small trained network that reads the words of a sentence beside the grammar, and revises its reading."""
