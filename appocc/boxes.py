"""Annotated 3D boxes, many at once, and the class of each: one place that knows what a vehicle is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from appocc.checks import (
    BoolArray,
    FloatArray,
    IntArray,
    check_finite,
    check_place,
    check_shape,
    check_transform,
    frozen,
)
from appocc.errors import ShapeError
from appocc.geometry import apply, inverse, yaw_of
from appocc.typing import Corners, Flags, List3, Numbers, Transform

# Corners in units of half the size (length, width, height): the lower four counter-clockwise, then the upper.
_CORNERS = np.array(
    [[1, 1, -1], [-1, 1, -1], [-1, -1, -1], [1, -1, -1], [1, 1, 1], [-1, 1, 1], [-1, -1, 1], [1, -1, 1]],
    dtype=np.float64,
)
# The sides of no object in a street are longer.
LARGEST_M = 1000.0
# Lyft writes plain names where nuScenes writes dotted ones.
_LYFT_VEHICLES = frozenset({"car", "truck", "bus", "other_vehicle", "emergency_vehicle", "motorcycle"})


def is_vehicle(category: str) -> bool:
    """Whether a nuScenes (or Lyft) category belongs to the class vehicle: all `vehicle.*` but bicycles."""
    return (category.startswith("vehicle.") and category != "vehicle.bicycle") or category in _LYFT_VEHICLES


@dataclass(frozen=True)
class Boxes:
    """N boxes in one frame (the frame is named by the variable that holds them, such as `boxes_world`).

    Attributes:
        centre_m: (N, 3) box centres.
        size_wlh_m: (N, 3) width, length, height: nuScenes' order.
        rotation: (N, 3, 3) frame-from-box rotations; the box's x axis is its heading.
        category: N category names.
        instance: N instance tokens (the same object over time).
        token: N annotation tokens.
        velocity_mps: (N, 2) horizontal velocity in the frame, NaN where unknown.
        lidar_points: (N,) LiDAR points inside, -1 where unknown.
    """

    centre_m: FloatArray
    size_wlh_m: FloatArray
    rotation: FloatArray
    category: tuple[str, ...]
    instance: tuple[str, ...]
    token: tuple[str, ...]
    velocity_mps: FloatArray
    lidar_points: IntArray

    def __post_init__(self) -> None:
        """Check shapes and ranges.

        Raises:
            ShapeError: if an array does not fit or a size is not positive.
        """
        n = len(self.category)
        check_shape("boxes centre_m", self.centre_m, (n, 3))
        check_shape("boxes size_wlh_m", self.size_wlh_m, (n, 3))
        check_shape("boxes rotation", self.rotation, (n, 3, 3))
        check_shape("boxes velocity_mps", self.velocity_mps, (n, 2))
        check_shape("boxes lidar_points", self.lidar_points, (n,))
        check_place("boxes centre_m", self.centre_m)
        check_finite("boxes rotation", self.rotation)
        if len(self.instance) != n or len(self.token) != n:
            raise ShapeError(f"boxes: expected {n} tokens, got {len(self.instance)} and {len(self.token)}")
        good = ((self.size_wlh_m > 0) & (self.size_wlh_m < LARGEST_M)).all(axis=1)
        if not good.all():
            i = int(np.argmin(good))
            size = self.size_wlh_m[i].tolist()
            raise ShapeError(f"box {self.token[i]}: expected a positive size below {LARGEST_M:.0f} m, got {size}")
        for array in (self.centre_m, self.size_wlh_m, self.rotation, self.velocity_mps, self.lidar_points):
            frozen(array)

    @classmethod
    def empty(cls) -> Boxes:
        """No boxes."""
        zero3, zero2 = np.zeros((0, 3)), np.zeros((0, 2))
        return cls(zero3, zero3.copy(), np.zeros((0, 3, 3)), (), (), (), zero2, np.zeros(0, np.int64))

    def __len__(self) -> int:
        """Number of boxes."""
        return len(self.category)

    def select(self, keep: BoolArray | IntArray) -> Boxes:
        """The boxes of a mask (N,) or of indices."""
        index = np.arange(len(self))[keep]
        return Boxes(
            self.centre_m[index],
            self.size_wlh_m[index],
            self.rotation[index],
            tuple(self.category[i] for i in index),
            tuple(self.instance[i] for i in index),
            tuple(self.token[i] for i in index),
            self.velocity_mps[index],
            self.lidar_points[index],
        )

    def vehicles(self) -> Boxes:
        """Only those of the class vehicle."""
        return self.select(np.array([is_vehicle(name) for name in self.category], dtype=np.bool_))

    def transformed(self, target_from_source: Transform) -> Boxes:
        """The same boxes in another frame."""
        check_transform("target_from_source", target_from_source)
        turn = target_from_source[:3, :3]
        velocity = np.pad(self.velocity_mps, ((0, 0), (0, 1))) @ turn.T
        return Boxes(
            apply(target_from_source, self.centre_m),
            self.size_wlh_m.copy(),
            turn @ self.rotation,
            self.category,
            self.instance,
            self.token,
            velocity[:, :2].copy(),
            self.lidar_points.copy(),
        )

    @property
    def yaw_rad(self) -> Numbers:
        """(N,) headings about +z of the frame."""
        return yaw_of(self.rotation)

    def frame_from_box(self, i: int) -> Transform:
        """(4, 4) pose of box i: origin at its centre, x along its length, y to its left, z up."""
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = self.rotation[i], self.centre_m[i]
        return pose

    def half_lwh_m(self) -> List3:
        """(N, 3) half sizes along the box's own x, y, z axes (length, width, height)."""
        return self.size_wlh_m[:, [1, 0, 2]] / 2

    def corners(self) -> Corners:
        """(N, 8, 3) corners: lower four counter-clockwise from front left, then the upper four."""
        local = _CORNERS[None] * self.half_lwh_m()[:, None]
        return np.asarray(np.einsum("nij,nkj->nki", self.rotation, local) + self.centre_m[:, None])

    def inside(self, points: List3, margin_m: float = 0.0) -> Flags:
        """(P,) whether each of the points (P, 3) lies in any box, grown on all sides by `margin_m`."""
        hit = np.zeros(len(points), dtype=np.bool_)
        x = np.ascontiguousarray(points[:, 0])
        for i, half in enumerate(self.half_lwh_m() + margin_m):
            # A slab around the box first: it leaves few points for the exact test.
            near = np.flatnonzero(np.abs(x - self.centre_m[i, 0]) <= np.linalg.norm(half))
            local = apply(inverse(self.frame_from_box(i)), points[near])
            hit[near[(np.abs(local) <= half).all(axis=1)]] = True
        return hit
