"""Evaluation of tracks: CLEAR, identity, HOTA and AMOTA metrics."""
