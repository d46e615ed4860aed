"""Meaning of a command: command frames of a discourse, coreference, and the query built from them."""
