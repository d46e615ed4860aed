"""The actors of a moment as nuScenes' annotations."""

from __future__ import annotations

import numpy as np

from appocc.checks import FloatArray, IntArray
from appocc.geometry import transform
from appocc.nuscenes.writer import Annotation
from appocc.simulation.traffic import Light
from appocc.simulation.truth.objects import Objects, category_of
from appocc.simulation.truth.visibility import visibility_token

# Slower than this, a vehicle in the road has stopped.
_STOPPED_MPS = 0.3


def annotate(
    objects: Objects, world_from_town: FloatArray, lidar_points: IntArray, seen_share: FloatArray
) -> list[Annotation]:
    """One annotation an object, in their order; the name of the actor is the instance.

    Args:
        objects: N actors around the ego, the ego left out (`objects_near` with nuScenes-like 80 m).
        world_from_town: (4, 4) where the town lies in the world of the dataset.
        lidar_points: (N,) LiDAR points on each, -1 where unknown.
        seen_share: (N,) share of its pixels in all cameras that is seen, see `visibility.seen_shares`.
    """
    rows = []
    for i, actor in enumerate(objects.actors):
        cos, sin = np.cos(objects.yaw_rad[i]), np.sin(objects.yaw_rad[i])
        town_from_box = transform([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]], objects.centre_m[i])
        length, width, height = actor.size_lwh_m
        rows.append(
            Annotation(
                instance=actor.name,
                category=category_of(actor),
                world_from_box=world_from_town @ town_from_box,
                size_wlh_m=(width, length, height),
                attribute=attribute_of(actor.kind, int(objects.lights[i]), float(np.hypot(*objects.velocity_mps[i]))),
                lidar_points=int(lidar_points[i]),
                visibility=visibility_token(float(seen_share[i])),
            )
        )
    return rows


def attribute_of(kind: str, lights: int, speed_mps: float) -> str:
    """The attribute in nuScenes of an actor; empty for people, as `ATTRIBUTES` has none for them."""
    parked = bool(lights & Light.PARKED)
    if kind == "pedestrian":
        return ""
    if kind in ("motorcycle", "bicycle"):
        return "cycle.without_rider" if parked else "cycle.with_rider"
    if parked:
        return "vehicle.parked"
    return "vehicle.stopped" if speed_mps < _STOPPED_MPS else "vehicle.moving"
