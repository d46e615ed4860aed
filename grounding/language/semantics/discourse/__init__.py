"""Discourse: clauses read in order to command frames, mentions and exclusions."""
