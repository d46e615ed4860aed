"""Datasets in the nuScenes schema: reading, writing and validation."""

from appocc.nuscenes.dataset import Dataset
from appocc.nuscenes.records import Sample, SampleData, Scene

__all__ = ["Dataset", "Sample", "SampleData", "Scene"]
