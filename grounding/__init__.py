"""Driving commands to one metric cell: sentence, query, referent, target."""
