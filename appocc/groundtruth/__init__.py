"""Ground-truth BEV maps from recorded sensors and boxes (paper, section IV.C)."""
