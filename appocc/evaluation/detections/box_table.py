"""Boxes of many key frames as one table, detected or annotated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from appocc.boxes import Boxes, is_vehicle
from appocc.checks import BoolArray, FloatArray, IntArray, check_shape, freeze_arrays
from appocc.geometry import rotation_from_quaternion, yaw_of
from appocc.nuscenes.detection_results import ResultBox

CYCLES = ("bicycle", "motorcycle")
_WIDTHS = {"centre_m": 3, "size_wlh_m": 3, "velocity_mps": 2, "rgb": 3}


@dataclass(frozen=True, kw_only=True, eq=False)
class BoxTable:
    """N boxes in the world frame; metres, radians.

    Attributes:
        sample: (N,) index of the key frame.
        centre_m: (N, 3) centres.
        size_wlh_m: (N, 3) width, length, height.
        yaw_rad: (N,) headings.
        velocity_mps: (N, 2) velocities over the ground; NaN if unknown.
        kind: (N,) classes of the detection benchmark; '' for other annotated categories.
        attribute: (N,) attributes; '' if unknown.
        score: (N,) confidences; 1 for annotated boxes.
        rgb: (N, 3) paint, sRGB 0..255; NaN if unknown.
        distance_m: (N,) distances from the ego origin on the ground.
        vehicle: (N,) whether it is of the class vehicle, which excludes bicycles.
        left_out: (N,) whether the benchmark leaves it out: a true box without points, a cycle in a bicycle rack.
    """

    sample: IntArray
    centre_m: FloatArray
    size_wlh_m: FloatArray
    yaw_rad: FloatArray
    velocity_mps: FloatArray
    kind: NDArray[np.str_]
    attribute: NDArray[np.str_]
    score: FloatArray
    rgb: FloatArray
    distance_m: FloatArray
    vehicle: BoolArray
    left_out: BoolArray

    def __post_init__(self) -> None:
        """Check shapes.

        Raises:
            ShapeError: if one differs.
        """
        for name in _FIELDS:
            shape = (len(self.sample), *([_WIDTHS[name]] if name in _WIDTHS else []))
            check_shape(f"boxes {name}", getattr(self, name), shape)
        freeze_arrays(self, *_FIELDS)

    def __len__(self) -> int:
        """Number of boxes."""
        return len(self.sample)

    def select(self, keep: BoolArray | IntArray) -> BoxTable:
        """Return the boxes of a mask (N,) or of indices."""
        return BoxTable(**{name: getattr(self, name)[keep] for name in _FIELDS})

    @classmethod
    def concatenated(cls, parts: Sequence[BoxTable]) -> BoxTable:
        """Return the boxes of at least one table in one."""
        return cls(**{name: np.concatenate([getattr(part, name) for part in parts]) for name in _FIELDS})


_FIELDS = tuple(field.name for field in fields(BoxTable))


def detected_boxes(
    boxes: Sequence[Sequence[ResultBox]], world_from_ego: FloatArray, racks: Sequence[Boxes]
) -> BoxTable:
    """Return a detector's boxes of S >= 1 key frames.

    Args:
        boxes: S lists of boxes.
        world_from_ego: (S, 4, 4) ego poses.
        racks: S tables of bicycle racks in the world frame.

    Raises:
        ShapeError: if a number makes no sense, such as a quaternion of zeros.
    """
    parts = []
    for number, (own, pose, rack) in enumerate(zip(boxes, world_from_ego, racks, strict=True)):
        centre_m = np.array([box.translation for box in own], np.float64).reshape(-1, 3)
        kind = np.array([box.detection_name for box in own], np.str_)
        unknown = [np.nan] * 3
        parts.append(
            BoxTable(
                sample=np.full(len(own), number, np.int64),
                centre_m=centre_m,
                size_wlh_m=np.array([box.size for box in own], np.float64).reshape(-1, 3),
                yaw_rad=yaw_of(rotation_from_quaternion(np.array([box.rotation for box in own]).reshape(-1, 4))),
                velocity_mps=np.array([box.velocity for box in own], np.float64).reshape(-1, 2),
                kind=kind,
                attribute=np.array([box.attribute_name for box in own], np.str_),
                score=np.array([box.detection_score for box in own], np.float64),
                rgb=np.array([box.paint_rgb or unknown for box in own], np.float64).reshape(-1, 3),
                distance_m=ego_distance_m(centre_m, pose),
                vehicle=np.array([is_vehicle(name) for name in kind], np.bool_),
                left_out=in_rack(centre_m, kind, rack),
            )
        )
    return BoxTable.concatenated(parts)


def ego_distance_m(centre_m: FloatArray, world_from_ego: FloatArray) -> FloatArray:
    """Return the distances (N,) on the ground of points (N, 3) from the ego origin, as the devkit computes them."""
    return np.asarray(np.hypot(*(centre_m - world_from_ego[:3, 3])[:, :2].T))


def in_rack(centre_m: FloatArray, kind: NDArray[np.str_], racks: Boxes) -> BoolArray:
    """Return (N,) whether boxes at centres (N, 3) are cycles in a bicycle rack."""
    return np.isin(kind, CYCLES) & racks.inside(centre_m)
