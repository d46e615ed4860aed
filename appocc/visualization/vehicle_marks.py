"""Vehicles to draw on a map, from annotated boxes, objects of a map, or instances."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from appocc.boxes import Boxes
from appocc.checks import BoolArray, FloatArray, IntArray
from appocc.objects import PEOPLE, BEVObjects


class VehicleMarks(NamedTuple):
    """Vehicles to draw on a map: N boxes in the ego frame.

    Attributes:
        centre_m: (N, 2) centres.
        yaw_rad: (N,) headings, counter-clockwise from x.
        length_width_m: (N, 2) sizes along the heading and across.
        heading_known: (N,) whether the front is known, and not only the axis.
        rgb: (N, 3) paint, sRGB 0..255; NaN leaves the colours of the cells.
    """

    centre_m: FloatArray
    yaw_rad: FloatArray
    length_width_m: FloatArray
    heading_known: BoolArray
    rgb: FloatArray

    @classmethod
    def of_boxes(cls, boxes: Boxes) -> VehicleMarks:
        """Return the marks of the vehicles among annotated boxes in the ego frame, without paint."""
        vehicles = boxes.vehicles()
        n, size = len(vehicles), vehicles.size_wlh_m[:, 1::-1]
        unknown = np.full((n, 3), np.nan)
        return cls(vehicles.centre_m[:, :2], vehicles.yaw_rad, size, np.ones(n, np.bool_), unknown)

    @classmethod
    def of_objects(cls, objects: BEVObjects) -> VehicleMarks:
        """Return the marks of the vehicles of a map's objects; people and cyclists are left out."""
        vehicles = objects.select(np.array([kind not in PEOPLE for kind in objects.kind], np.bool_))
        n, size = len(vehicles), vehicles.size_wlh_m[:, 1::-1]
        return cls(vehicles.centre_m[:, :2], vehicles.yaw_rad, size, np.ones(n, np.bool_), vehicles.rgb)

    def select(self, keep: BoolArray | IntArray) -> VehicleMarks:
        """Return the marks of a mask (N,) or of indices."""
        return VehicleMarks(
            self.centre_m[keep],
            self.yaw_rad[keep],
            self.length_width_m[keep],
            self.heading_known[keep],
            self.rgb[keep],
        )

    def near_first(self) -> VehicleMarks:
        """Return the marks by increasing distance from the ego."""
        return self.select(np.argsort(np.linalg.norm(self.centre_m, axis=1), kind="stable"))
