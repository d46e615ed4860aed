"""Objects of a bird's-eye-view map: a table of boxes with kind, velocity, paint and score, in the ego frame."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from appocc.boxes import Boxes, is_vehicle
from appocc.checks import (
    BoolArray,
    FloatArray,
    IntArray,
    check_finite,
    check_numbers,
    check_place,
    check_shape,
    frozen,
)
from appocc.errors import ShapeError
from appocc.geometry import footprints, quaternion_from_yaw, rotation_from_quaternion
from appocc.grid import BEVGrid
from appocc.rasterise import VEHICLE_SHARE, polygon_owner

# The detection classes of nuScenes that the network predicts.
KINDS = ("car", "truck", "bus", "motorcycle", "bicycle", "pedestrian")
PEOPLE = ("bicycle", "pedestrian")
# nuScenes annotation categories, by prefix, and their kind; Lyft, KITTI and results use plain names.
_PREFIXES = (
    ("vehicle.bicycle", "bicycle"),
    ("vehicle.motorcycle", "motorcycle"),
    ("vehicle.bus", "bus"),
    ("vehicle.truck", "truck"),
    ("vehicle.trailer", "truck"),
    ("vehicle.construction", "truck"),
    ("vehicle.emergency.ambulance", "truck"),
    ("vehicle", "car"),
    ("human.pedestrian", "pedestrian"),
)

# Keys of a map's file begin with this.
_PREFIX = "object_"
# Indices of objects are stored as int16.
_MOST = np.iinfo(np.int16).max


def kind_of(category: str) -> str | None:
    """Return the kind of an annotation category; None if it is none of `KINDS`."""
    if category in KINDS:
        return category
    return next((kind for prefix, kind in _PREFIXES if category.startswith(prefix)), None)


@dataclass(frozen=True, kw_only=True, eq=False)
class BEVObjects:
    """N objects of one map, in the ego frame of its sample; metres, radians.

    Attributes:
        centre_m: (N, 3) box centres.
        size_wlh_m: (N, 3) width, length, height: nuScenes' order.
        yaw_rad: (N,) heading, counter-clockwise from x.
        velocity_mps: (N, 2) velocity over the ground along the axes of the ego frame; NaN if unknown.
        kind: N names of `KINDS`.
        rgb: (N, 3) paint, sRGB 0..255; NaN if unknown.
        score: (N,) probability of the object, 0..1.
    """

    centre_m: FloatArray
    size_wlh_m: FloatArray
    yaw_rad: FloatArray
    velocity_mps: FloatArray
    kind: tuple[str, ...]
    rgb: FloatArray
    score: FloatArray

    def __post_init__(self) -> None:
        """Check shapes and values.

        Raises:
            ShapeError: if a shape differs, a required number is not finite, or a kind is unknown.
        """
        n = len(self.centre_m)
        if n > _MOST:
            raise ShapeError(f"objects: expected at most {_MOST}, got {n}")
        widths = {"centre_m": (3,), "size_wlh_m": (3,), "velocity_mps": (2,), "rgb": (3,)}
        for name in _ARRAYS:
            check_shape(f"objects {name}", getattr(self, name), (n, *widths.get(name, ())))
            copy = np.array(getattr(self, name), np.float64)
            frozen(copy)
            object.__setattr__(self, name, copy)
        check_place("objects centre_m", self.centre_m)
        for name in ("size_wlh_m", "yaw_rad", "score"):
            check_finite(f"objects {name}", getattr(self, name))
        for name in ("velocity_mps", "rgb"):
            if np.isinf(getattr(self, name)).any():
                raise ShapeError(f"objects {name}: expected finite numbers, or NaN where unknown, got infinity")
        if (self.size_wlh_m <= 0).any():
            raise ShapeError(f"objects: expected positive sizes, got {self.size_wlh_m.min():g} m")
        if n and not (self.score.min() >= 0 and self.score.max() <= 1):
            raise ShapeError(f"objects score: expected 0..1, got {self.score.min():g}..{self.score.max():g}")
        unknown = sorted(set(self.kind) - set(KINDS))
        if len(self.kind) != n or unknown:
            got = ", ".join(unknown) or len(self.kind)
            raise ShapeError(f"objects kind: expected {n} names of {', '.join(KINDS)}, got {got}")

    def __len__(self) -> int:
        """Number of objects."""
        return len(self.score)

    def select(self, keep: BoolArray | IntArray) -> BEVObjects:
        """Return the objects of a mask (N,) or of indices."""
        index = np.arange(len(self))[keep]
        chosen = {name: getattr(self, name)[index] for name in _ARRAYS}
        return replace(self, **chosen, kind=tuple(self.kind[i] for i in index))

    def painted(self, rgb: FloatArray) -> BEVObjects:
        """Return the objects with paint (N, 3)."""
        return replace(self, rgb=rgb)

    @property
    def boxes(self) -> Boxes:
        """The objects as boxes, named by their numbers."""
        names = tuple(map(str, range(len(self))))
        return Boxes(
            centre_m=self.centre_m,
            size_wlh_m=self.size_wlh_m,
            rotation=rotation_from_quaternion(quaternion_from_yaw(self.yaw_rad)),
            category=self.kind,
            instance=names,
            token=names,
            velocity_mps=self.velocity_mps,
            lidar_points=np.full(len(self), -1),
        )

    @property
    def are_vehicles(self) -> BoolArray:
        """(N,) whether each object is a vehicle, and not a person or a bicycle."""
        return np.array([is_vehicle(kind) for kind in self.kind], np.bool_)

    def vehicle_owner(self, grid: BEVGrid) -> IntArray:
        """(X, Y) index of the vehicle whose box covers most of a cell, at least half of it; -1 where none does."""
        vehicles = np.flatnonzero(self.are_vehicles)
        length_width_m = self.size_wlh_m[vehicles][:, [1, 0]]
        outlines = footprints(self.centre_m[vehicles, :2], self.yaw_rad[vehicles], length_width_m)
        return np.append(vehicles, -1)[polygon_owner(grid, outlines, VEHICLE_SHARE)]

    def as_arrays(self) -> dict[str, NDArray[np.generic]]:
        """Return the arrays as stored in the file of a map: `object_centre_m` and so on."""
        arrays = {f"{_PREFIX}{name}": getattr(self, name) for name in _ARRAYS}
        return {**arrays, f"{_PREFIX}kind": np.array(self.kind, np.str_)}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[np.generic]]) -> BEVObjects | None:
        """Return the objects among the arrays of a map's file; None if there are none.

        Raises:
            KeyError: if some of the arrays are missing.
            ShapeError: if one does not hold what it should.
        """
        if not any(name.startswith(_PREFIX) for name in arrays):
            return None
        found = {name: arrays[f"{_PREFIX}{name}"] for name in (*_ARRAYS, "kind")}
        kind = found.pop("kind")
        if kind.dtype.kind != "U" or kind.ndim != 1:
            raise ShapeError(f"objects kind: expected a row of names, got {kind.dtype} of shape {kind.shape}")
        for name, array in found.items():
            check_numbers(f"objects {name}", array)
            check_shape(f"objects {name}", array, (len(kind), *array.shape[1:]))
        numbers = {name: array.astype(np.float64) for name, array in found.items()}
        return cls(**numbers, kind=tuple(kind.tolist()))


_ARRAYS = tuple(field.name for field in fields(BEVObjects) if field.name != "kind")
