"""nuScenes annotations of the actors in a frame."""

from __future__ import annotations

import numpy as np

from appocc.checks import FloatArray, IntArray
from appocc.geometry import transform
from appocc.nuscenes.writer import Annotation, visibility_token
from appocc.simulation.traffic import Light
from appocc.simulation.truth.objects import ActorBoxes, category_of

# A vehicle in traffic below this speed counts as stopped.
_STOPPED_MPS = 0.3


def annotate(
    objects: ActorBoxes, world_from_town: FloatArray, lidar_points: IntArray, seen_share: FloatArray
) -> list[Annotation]:
    """Create one annotation per object, in their order; the name of the actor is the instance.

    Args:
        objects: N actors around the ego, without the ego (`objects_near` with nuScenes-like 80 m).
        world_from_town: (4, 4) pose of the town in the world frame of the dataset.
        lidar_points: (N,) LiDAR points on each, -1 if unknown.
        seen_share: (N,) visible share of its pixels in all cameras, see `visibility.visible_shares`.
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
    """Return the nuScenes attribute of an actor; empty for people, as `ATTRIBUTES` has none for them."""
    parked = bool(lights & Light.PARKED)
    if kind == "pedestrian":
        return ""
    if kind in ("motorcycle", "bicycle"):
        return "cycle.without_rider" if parked else "cycle.with_rider"
    if parked:
        return "vehicle.parked"
    return "vehicle.stopped" if speed_mps < _STOPPED_MPS else "vehicle.moving"
