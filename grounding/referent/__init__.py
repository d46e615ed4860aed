"""Referent resolution: which vehicle of the scene a query means."""
