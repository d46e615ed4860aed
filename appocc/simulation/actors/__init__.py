"""Vehicles, riders and pedestrians: body shapes, paints, and the assembly of one mesh per traffic state."""
