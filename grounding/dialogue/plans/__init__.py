"""Plans of several steps: their order, what is awaited between them, and following them while driving."""
