"""Data association: costs, the matching cascade, and the colour likelihood."""
