"""The actors around the ego in a frame, as boxes in the town frame, and their nuScenes categories."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from appocc.boxes import is_vehicle
from appocc.checks import BoolArray, ByteArray, FloatArray, IntArray, frozen
from appocc.errors import ShapeError
from appocc.geometry import footprints
from appocc.nuscenes.writer import CATEGORIES
from appocc.simulation.traffic import Actor, TrafficState

# nuScenes' categories: a pickup is a truck, a van is a car.
_CATEGORY_OF_BODY = {
    "sedan": "vehicle.car",
    "hatchback": "vehicle.car",
    "estate": "vehicle.car",
    "suv": "vehicle.car",
    "minivan": "vehicle.car",
    "van": "vehicle.car",
    "pickup": "vehicle.truck",
    "box_truck": "vehicle.truck",
    "bus": "vehicle.bus.rigid",
    "motorcycle": "vehicle.motorcycle",
    "bicycle": "vehicle.bicycle",
    "adult": "human.pedestrian.adult",
    "child": "human.pedestrian.child",
}


def category_of(actor: Actor) -> str:
    """Return the nuScenes category of an actor.

    Raises:
        ShapeError: if the body is unknown.
    """
    if actor.body not in _CATEGORY_OF_BODY:
        raise ShapeError(f"actor {actor.name}: expected a body of {', '.join(_CATEGORY_OF_BODY)}, got '{actor.body}'")
    return _CATEGORY_OF_BODY[actor.body]


def category_indices(actors: Sequence[Actor]) -> ByteArray:
    """Return (A,) uint8 index in nuScenes' `CATEGORIES` of each actor; LiDAR points take their label from it."""
    return np.array([CATEGORIES.index(category_of(actor)) for actor in actors], np.uint8)


@dataclass(frozen=True, eq=False, kw_only=True)
class ActorBoxes:
    """Boxes of N actors in a frame, town frame.

    Attributes:
        actors: static properties.
        number: (N,) their indices in the log's `actors`; the tag of their faces.
        centre_m: (N, 3) centres of the boxes; the boxes stand on z = 0.
        yaw_rad: (N,) headings.
        size_lwh_m: (N, 3) length, width, height.
        velocity_mps: (N, 2).
        lights: (N,) `Light` bits.
    """

    actors: tuple[Actor, ...]
    number: NDArray[np.int32]
    centre_m: FloatArray
    yaw_rad: FloatArray
    size_lwh_m: FloatArray
    velocity_mps: FloatArray
    lights: ByteArray

    def __post_init__(self) -> None:
        """Make the arrays read-only."""
        for array in (self.number, self.centre_m, self.yaw_rad, self.size_lwh_m, self.velocity_mps, self.lights):
            frozen(array)

    def __len__(self) -> int:
        """Number of actors."""
        return len(self.actors)

    def footprints(self) -> FloatArray:
        """Return (N, 4, 2) corners of the boxes on the ground, counter-clockwise from front left, town frame."""
        return footprints(self.centre_m[:, :2], self.yaw_rad, self.size_lwh_m[:, :2])

    def corners(self) -> FloatArray:
        """Return (N, 8, 3) corners: the lower four counter-clockwise from front left, then the upper four."""
        ground = self.footprints()
        low = np.concatenate([ground, np.zeros((*ground.shape[:2], 1))], axis=2)
        high = low.copy()
        high[..., 2] = self.size_lwh_m[:, 2, None]
        return np.concatenate([low, high], axis=1)

    def are_vehicles(self) -> BoolArray:
        """Return (N,) whether each belongs to the class vehicle."""
        return np.array([is_vehicle(category_of(actor)) for actor in self.actors], np.bool_)

    def select(self, keep: BoolArray) -> ActorBoxes:
        """Return the objects of a mask (N,)."""
        return ActorBoxes(
            actors=tuple(actor for actor, kept in zip(self.actors, keep, strict=True) if kept),
            number=self.number[keep],
            centre_m=self.centre_m[keep],
            yaw_rad=self.yaw_rad[keep],
            size_lwh_m=self.size_lwh_m[keep],
            velocity_mps=self.velocity_mps[keep],
            lights=self.lights[keep],
        )


def objects_near(
    actors: Sequence[Actor], state: TrafficState, centre_xy_m: FloatArray, range_m: float, ego: int = -1
) -> ActorBoxes:
    """Return the actors of a traffic state whose centre is within a range of a point (2,), town frame.

    Args:
        actors: actors of the log.
        state: their poses.
        centre_xy_m: (2,) usually the position of the ego.
        range_m: radius; infinite for all.
        ego: index of the actor to leave out, -1 for none.
    """
    away = np.hypot(*(state.xy_m - np.asarray(centre_xy_m)[:2]).T)
    keep = np.flatnonzero((away <= range_m) & (state.index != ego))
    chosen = tuple(actors[number] for number in state.index[keep])
    size = np.array([actor.size_lwh_m for actor in chosen], np.float64).reshape(-1, 3)
    return ActorBoxes(
        actors=chosen,
        number=state.index[keep].astype(np.int32),
        centre_m=np.concatenate([state.xy_m[keep], size[:, 2:] / 2], axis=1),
        yaw_rad=np.asarray(state.yaw_rad[keep], np.float64),
        size_lwh_m=size,
        velocity_mps=np.asarray(state.velocity_mps[keep], np.float64),
        lights=state.lights[keep].copy(),
    )


def count_lidar_points(actor: NDArray[np.int32], number: NDArray[np.int32]) -> IntArray:
    """Count the LiDAR points (N,) on each actor `number` (N,); `actor` (P,) is the actor that each point hit."""
    hit = actor[actor >= 0]
    counts = np.bincount(hit, minlength=int(max(number.max(initial=-1), hit.max(initial=-1))) + 1)
    return np.asarray(counts[number], np.int64)
