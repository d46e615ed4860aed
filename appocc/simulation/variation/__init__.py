"""Random variation of a scene beyond the real world's: cameras, traffic, paints, materials and light."""
