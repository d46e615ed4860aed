"""Boxes, paints and visibility of the actors around the ego vehicle."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from appocc.camera import Camera
from appocc.carla.frames import point_of, pose_of
from appocc.checks import Float32Array, FloatArray
from appocc.geometry import apply, inverse
from appocc.nuscenes.writer import Annotation

_RANGE_M = 80.0
_STOPPED_MPS = 0.3
_LEAST_M = 0.1
_KINDS = {
    "car": "vehicle.car",
    "van": "vehicle.car",
    "truck": "vehicle.truck",
    "bus": "vehicle.bus.rigid",
    "motorcycle": "vehicle.motorcycle",
    "bicycle": "vehicle.bicycle",
}
_EMERGENCY = {"police": "vehicle.emergency.police", "ambulance": "vehicle.emergency.ambulance"}
# Blueprints of bicycles of servers that do not tell the attribute base_type.
_BICYCLES = ("crossbike", "omafiets", "century")
# Parked vehicles that are a part of the map, by the name of their label.
_STANDING = {
    "Car": "vehicle.car",
    "Truck": "vehicle.truck",
    "Bus": "vehicle.bus.rigid",
    "Motorcycle": "vehicle.motorcycle",
    "Bicycle": "vehicle.bicycle",
}
# Nothing nearer than this before a point of a box hides it.
_HIDDEN_M = 0.3
_SIDE = np.linspace(-0.8, 0.8, 5)


class Seen(NamedTuple):
    """An object at a key frame.

    Attributes:
        box: its box.
        rgb: paint, sRGB 0..255; None if unknown.
        body: blueprint.
    """

    box: Annotation
    rgb: tuple[int, int, int] | None = None
    body: str = ""


def category_of(type_id: str, attributes: Mapping[str, str]) -> str:
    """Return the nuScenes category of an actor, by its blueprint."""
    if type_id.startswith("walker."):
        return "human.pedestrian.child" if attributes.get("age") == "child" else "human.pedestrian.adult"
    special = next((category for word, category in _EMERGENCY.items() if word in type_id), None)
    if special is not None:
        return special
    kind = attributes.get("base_type", "").lower()
    if kind not in _KINDS:
        kind = "car" if attributes.get("number_of_wheels", "4") != "2" else "motorcycle"
        kind = "bicycle" if any(word in type_id for word in _BICYCLES) else kind
    return _KINDS[kind]


def moving_objects(actors: Iterable[Any], snapshot: Any, ego: int, centre_m: FloatArray) -> Iterator[Seen]:
    """Yield the vehicles and walkers around a point (3,) of the world at a snapshot, in order of their numbers."""
    for actor in sorted(actors, key=lambda each: int(each.id)):
        state = snapshot.find(actor.id)
        if actor.id == ego or state is None or not actor.type_id.startswith(("vehicle.", "walker.")):
            continue
        world_from_box = pose_of(state.get_transform()) @ pose_of(actor.bounding_box)
        category = category_of(actor.type_id, actor.attributes)
        speed = float(np.linalg.norm(point_of(state.get_velocity())))
        box = Annotation(
            instance=f"actor-{actor.id}",
            category=category,
            world_from_box=world_from_box,
            size_wlh_m=_size(actor.bounding_box),
            attribute=_attribute(category, speed),
        )
        if is_near(box, centre_m):
            yield Seen(box, _paint(actor.attributes.get("color", "")), actor.type_id)


def is_near(box: Annotation, centre_m: FloatArray) -> bool:
    """Return whether a box is within 80 m of a point (3,) of the world."""
    return bool(np.hypot(*(box.world_from_box[:2, 3] - centre_m[:2])) <= _RANGE_M)


def standing_objects(carla: Any, world: Any) -> list[Seen]:
    """Return the parked vehicles that are a part of the map; of several parts at one place the largest."""
    largest: dict[tuple[float, ...], tuple[float, Seen]] = {}
    for label, category in _STANDING.items():
        for each in world.get_environment_objects(getattr(carla.CityObjectLabel, label)):
            box = each.bounding_box  # in the world's frame
            cycle = category in ("vehicle.motorcycle", "vehicle.bicycle")
            seen = Seen(
                Annotation(
                    instance=f"parked-{each.id}",
                    category=category,
                    world_from_box=pose_of(box),
                    size_wlh_m=_size(box),
                    attribute="cycle.without_rider" if cycle else "vehicle.parked",
                ),
                body=str(each.name),
            )
            place, volume = tuple(point_of(box.location).round().tolist()), float(np.prod(seen.box.size_wlh_m))
            if place not in largest or volume > largest[place][0]:
                largest[place] = volume, seen
    return [seen for _, seen in largest.values()]


def visible_share(box: Annotation, world_from_ego: FloatArray, views: Iterable[tuple[Camera, Float32Array]]) -> float:
    """Return the share of a box's surface, of what is turned to a camera and in its picture, that nothing hides.

    Args:
        box: the box.
        world_from_ego: (4, 4) pose of the ego vehicle.
        views: cameras with depths (H, W).
    """
    points, normals = _surface(box)
    inside = hidden = 0
    for camera, depth in views:
        cam_from_box = inverse(world_from_ego @ camera.ego_from_cam) @ box.world_from_box
        places = apply(cam_from_box, points)
        towards = ((normals @ cam_from_box[:3, :3].T) * places).sum(axis=1) < 0
        uv, ahead = camera.project(places)
        seen = camera.sees(uv, ahead) & towards
        column, row = np.rint(uv[seen]).astype(int).T if seen.any() else np.empty((2, 0), int)
        measured = depth[np.clip(row, 0, camera.height_px - 1), np.clip(column, 0, camera.width_px - 1)]
        inside += int(seen.sum())
        hidden += int((measured < ahead[seen] - _HIDDEN_M).sum())
    return 1 - hidden / inside if inside else 0.0


def _surface(box: Annotation) -> tuple[FloatArray, FloatArray]:
    """Return points (150, 3) on the six sides of a box, in its frame, and their outward normals (150, 3)."""
    half = np.array(box.size_wlh_m)[[1, 0, 2]] / 2
    a, b = (each.ravel() for each in np.meshgrid(_SIDE, _SIDE))
    points, normals = [], []
    for axis in range(3):
        for side in (-1.0, 1.0):
            points.append(np.insert(np.stack([a, b], axis=1), axis, side, axis=1) * half)
            normals.append(np.tile(np.eye(3)[axis] * side, (len(a), 1)))
    return np.concatenate(points), np.concatenate(normals)


def _size(box: Any) -> tuple[float, float, float]:
    return (
        max(2 * box.extent.y, _LEAST_M),
        max(2 * box.extent.x, _LEAST_M),
        max(2 * box.extent.z, _LEAST_M),
    )


def _attribute(category: str, speed_mps: float) -> str:
    if category.startswith("human."):
        return ""
    if category in ("vehicle.motorcycle", "vehicle.bicycle"):
        return "cycle.with_rider"
    return "vehicle.stopped" if speed_mps < _STOPPED_MPS else "vehicle.moving"


def _paint(text: str) -> tuple[int, int, int] | None:
    """Return the paint of an attribute such as '17,37,103'."""
    parts = text.split(",")
    if len(parts) != 3 or not all(part.strip().isdigit() for part in parts):
        return None
    red, green, blue = (min(int(part), 255) for part in parts)
    return red, green, blue
