"""Annotated 3D boxes as arrays, and which categories are vehicles."""

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
    freeze_arrays,
)
from appocc.errors import ShapeError
from appocc.geometry import apply, inverse, yaw_of
from appocc.typing import Corners, Flags, List3, Numbers, Transform

# Corners in units of half the size (length, width, height): the lower four counter-clockwise, then the upper.
_CORNERS = np.array(
    [[1, 1, -1], [-1, 1, -1], [-1, -1, -1], [1, -1, -1], [1, 1, 1], [-1, 1, 1], [-1, -1, 1], [1, -1, 1]],
    dtype=np.float64,
)
# Upper bound of box dimensions.
LARGEST_M = 1000.0
# Lyft, KITTI and nuScenes' tasks use plain names; nuScenes' annotations use dotted ones.
_PLAIN_VEHICLES = frozenset(
    {"car", "van", "truck", "trailer", "bus", "construction_vehicle", "other_vehicle", "emergency_vehicle"}
    | {"motorcycle"}
)
_PEOPLE_AND_BICYCLES = ("human.", "pedestrian", "person", "bicycle", "vehicle.bicycle", "cyclist")


def is_vehicle(category: str) -> bool:
    """Return whether a nuScenes, Lyft or KITTI category belongs to the class vehicle, which excludes bicycles."""
    return (category.startswith("vehicle.") and category != "vehicle.bicycle") or category in _PLAIN_VEHICLES


def is_person_or_bicycle(category: str) -> bool:
    """Return whether a nuScenes, Lyft or KITTI category is a person or a bicycle, with or without rider."""
    return category.startswith(_PEOPLE_AND_BICYCLES)


@dataclass(frozen=True, eq=False, kw_only=True)
class Boxes:
    """N boxes in one frame, which is part of the variable name, such as `boxes_world`.

    Attributes:
        centre_m: (N, 3) box centres.
        size_wlh_m: (N, 3) width, length, height: nuScenes' order.
        rotation: (N, 3, 3) frame-from-box rotations; the x axis of the box is its heading.
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
        freeze_arrays(self, "centre_m", "size_wlh_m", "rotation", "velocity_mps", "lidar_points")

    @classmethod
    def empty(cls) -> Boxes:
        """Return zero boxes."""
        return cls(
            centre_m=np.zeros((0, 3)),
            size_wlh_m=np.zeros((0, 3)),
            rotation=np.zeros((0, 3, 3)),
            category=(),
            instance=(),
            token=(),
            velocity_mps=np.zeros((0, 2)),
            lidar_points=np.zeros(0, np.int64),
        )

    def __len__(self) -> int:
        """Number of boxes."""
        return len(self.category)

    def select(self, keep: BoolArray | IntArray) -> Boxes:
        """Return the boxes of a mask (N,) or of indices."""
        index = np.arange(len(self))[keep]
        return Boxes(
            centre_m=self.centre_m[index],
            size_wlh_m=self.size_wlh_m[index],
            rotation=self.rotation[index],
            category=tuple(self.category[i] for i in index),
            instance=tuple(self.instance[i] for i in index),
            token=tuple(self.token[i] for i in index),
            velocity_mps=self.velocity_mps[index],
            lidar_points=self.lidar_points[index],
        )

    def vehicles(self) -> Boxes:
        """Return the boxes of the class vehicle."""
        return self.select(np.array([is_vehicle(name) for name in self.category], dtype=np.bool_))

    def transformed(self, target_from_source: Transform) -> Boxes:
        """Return the boxes transformed to another frame."""
        check_transform("target_from_source", target_from_source)
        rotation = target_from_source[:3, :3]
        velocity = np.pad(self.velocity_mps, ((0, 0), (0, 1))) @ rotation.T
        return Boxes(
            centre_m=apply(target_from_source, self.centre_m),
            size_wlh_m=self.size_wlh_m.copy(),
            rotation=rotation @ self.rotation,
            category=self.category,
            instance=self.instance,
            token=self.token,
            velocity_mps=velocity[:, :2].copy(),
            lidar_points=self.lidar_points.copy(),
        )

    @property
    def yaw_rad(self) -> Numbers:
        """(N,) headings about +z of the frame."""
        return yaw_of(self.rotation)

    def frame_from_box(self, i: int) -> Transform:
        """Return the (4, 4) pose of box i: origin at its centre, x along its length, y to its left, z up."""
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = self.rotation[i], self.centre_m[i]
        return pose

    def half_lwh_m(self) -> List3:
        """Return (N, 3) half sizes along the x, y, z axes of the boxes (length, width, height)."""
        return self.size_wlh_m[:, [1, 0, 2]] / 2

    def corners(self) -> Corners:
        """Return (N, 8, 3) corners: lower four counter-clockwise from front left, then the upper four."""
        local = _CORNERS[None] * self.half_lwh_m()[:, None]
        return np.asarray(np.einsum("nij,nkj->nki", self.rotation, local) + self.centre_m[:, None])

    def inside(self, points: List3, margin_m: float = 0.0) -> Flags:
        """Return (P,) whether points (P, 3) are inside any box enlarged by `margin_m` on all sides."""
        hit = np.zeros(len(points), dtype=np.bool_)
        x = np.ascontiguousarray(points[:, 0])
        for i, half in enumerate(self.half_lwh_m() + margin_m):
            # A coarse test on x leaves few points for the exact test.
            near = np.flatnonzero(np.abs(x - self.centre_m[i, 0]) <= np.linalg.norm(half))
            local = apply(inverse(self.frame_from_box(i)), points[near])
            hit[near[(np.abs(local) <= half).all(axis=1)]] = True
        return hit
