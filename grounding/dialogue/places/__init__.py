"""Turns that say where the place in force is to be instead: gaps, edges and sides, further on, somewhere else."""
