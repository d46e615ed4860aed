"""Lenses of cameras: where a point of the camera frame appears in the picture, and which ray a pixel sees.

The camera frame is x right, y down, z ahead; pixel centres are at whole numbers (OpenCV).
"""

from __future__ import annotations

from appocc.lenses.distorted import DistortedLens
from appocc.lenses.fisheye import FisheyeLens, kannala_brandt, ocamcalib, polynomial_fisheye, unified_sphere
from appocc.lenses.lens import Lens

__all__ = [
    "DistortedLens",
    "FisheyeLens",
    "Lens",
    "kannala_brandt",
    "ocamcalib",
    "polynomial_fisheye",
    "unified_sphere",
]
