"""Visualization of maps, rigs, predictions and datasets."""
