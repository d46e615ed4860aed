"""Data association: costs, the matching cascade, and the likelihood of colours."""
