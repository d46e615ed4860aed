"""The nuScenes schema: thirteen JSON tables beside samples/, sweeps/ and maps/; read, written and checked."""

from appocc.nuscenes.dataset import Dataset
from appocc.nuscenes.records import Sample, SampleData, Scene

__all__ = ["Dataset", "Sample", "SampleData", "Scene"]
