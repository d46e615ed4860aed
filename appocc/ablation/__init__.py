"""Ablation study: the paper's tables on other data, from many small trainings that differ in one factor each."""
