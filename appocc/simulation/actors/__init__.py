"""Vehicles, riders and walkers: their shapes, paints, and one mesh of all of them at a moment."""
