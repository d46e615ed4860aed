"""Colour bird's-eye views from surround cameras: data in the nuScenes schema, geometry, maps, and their prediction.

The names of `__all__` are imported on first use, so that `import appocc` stays fast.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from appocc.lazy import lazy_exports
from appocc.version import __version__ as __version__

if TYPE_CHECKING:
    from appocc.bevmap import BEVMap, load_map
    from appocc.boxes import Boxes
    from appocc.camera import Camera, CameraRig
    from appocc.ego_vehicle import EgoVehicle
    from appocc.errors import AppoccError
    from appocc.files import read_image, write_image
    from appocc.frame import Frame
    from appocc.grid import BEVGrid
    from appocc.inference.loading import load_predictor
    from appocc.inference.predictor import Prediction, Predictor
    from appocc.nuscenes import Dataset
    from appocc.rigs import read_rig, read_source_rig
    from appocc.rigs.source_rig import SourceRig

__all__ = [
    "AppoccError",
    "BEVGrid",
    "BEVMap",
    "Boxes",
    "Camera",
    "CameraRig",
    "Dataset",
    "EgoVehicle",
    "Frame",
    "Prediction",
    "Predictor",
    "SourceRig",
    "load_map",
    "load_predictor",
    "read_image",
    "read_rig",
    "read_source_rig",
    "write_image",
]
_MODULES = {
    "AppoccError": "appocc.errors",
    "BEVGrid": "appocc.grid",
    "BEVMap": "appocc.bevmap",
    "Boxes": "appocc.boxes",
    "Camera": "appocc.camera",
    "CameraRig": "appocc.camera",
    "Dataset": "appocc.nuscenes",
    "EgoVehicle": "appocc.ego_vehicle",
    "Frame": "appocc.frame",
    "Prediction": "appocc.inference.predictor",
    "Predictor": "appocc.inference.predictor",
    "SourceRig": "appocc.rigs.source_rig",
    "load_map": "appocc.bevmap",
    "load_predictor": "appocc.inference.loading",
    "read_image": "appocc.files",
    "read_rig": "appocc.rigs",
    "read_source_rig": "appocc.rigs",
    "write_image": "appocc.files",
}

if not TYPE_CHECKING:
    __getattr__, __dir__ = lazy_exports(__name__, _MODULES)
