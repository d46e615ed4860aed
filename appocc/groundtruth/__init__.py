"""Ground-truth colour BEVs from recorded sensors and boxes (paper, section IV.C)."""
