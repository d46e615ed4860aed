"""A key frame as JSON for the page: cameras, grid, vehicles with trails, annotated boxes, poses."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from appocc.bevmap import BEVMap
from appocc.boxes import Boxes
from appocc.camera import Camera
from appocc.checks import FloatArray
from appocc.frame import Frame
from appocc.geometry import apply, inverse
from appocc.visualization.cameras import camera_rows
from cli.server.cache import BoundedCache
from cli.server.recording import Place, Recording
from cli.server.scene_tracks import Frames, SceneVehicles, TrackStore
from grounding.describe import describe_object
from grounding.referent.scene import SceneModel, scene_from_boxes, scene_from_map, scene_from_tracks
from grounding.scene_object import SceneObject
from tracking.tracks import Track
from tracking.vehicle_classes import HEIGHT_M

# Key frames of a trail, and of the path of a vehicle to either side of a frame.
_TRAIL, _PATH = 12, 100
_MOST_SCENES = 24


class Moments:
    """Key frames of recordings with their vehicles."""

    def __init__(self, store: TrackStore) -> None:
        """Use a store of tracks."""
        self._store = store
        self._scenes: BoundedCache[tuple[object, ...], tuple[SceneModel, Frames]] = BoundedCache(_MOST_SCENES)

    def vehicles(self, recording: Recording, place: Place) -> tuple[SceneVehicles, Sequence[Track] | Boxes | None]:
        """Return where the vehicles come from, and those of the key frame as `Grounder.set_scene` takes them."""
        recording.check_source(place.source)
        found = self._store.vehicles(recording, place.scene, place.source)
        if found.kind == "tracks":
            return found, found.tracks[place.frame]
        return found, recording.frame(place.scene, place.frame).boxes_ego if found.kind == "boxes" else None

    def as_json(self, recording: Recording, place: Place) -> dict[str, Any]:
        """Return a key frame; without a map, `map` is None and `problem` gives the reason."""
        frame = recording.frame(place.scene, place.frame)
        first = recording.samples(place.scene)[0]
        found: dict[str, Any] = {
            "frame": place.frame,
            "time_s": round((frame.timestamp_us - first.timestamp_us) * 1e-6, 3),
            "world_from_ego": _rounded(frame.world_from_ego),
            "rows": [[camera.channel for camera in row] for row in camera_rows(frame.rig)],
            "cameras": {camera.channel: _camera(camera) for camera in frame.rig},
            "boxes": _boxes(frame),
            "ego": _ego(frame),
            "map": None,
            "vehicles": [],
            "tracking": None,
        }
        if place.source:
            bev = recording.bev(place)
            source, at_frame = self.vehicles(recording, place)
            scene = self._scene(recording, place, source, bev, at_frame, frame)
            found["map"] = _map(bev)
            found["vehicles"] = self._items(recording, place, source, scene)
            found["tracking"] = {"kind": source.kind, "share": source.share, "problem": source.problem}
        return found

    def _scene(
        self,
        recording: Recording,
        place: Place,
        source: SceneVehicles,
        bev: BEVMap,
        at_frame: Sequence[Track] | Boxes | None,
        frame: Frame,
    ) -> SceneModel:
        """Return the scene model of a key frame: classes, colours and motion as a conversation sees them."""

        def build() -> tuple[SceneModel, Frames]:
            if at_frame is None:
                return scene_from_map(bev, frame.world_from_ego), ()
            if isinstance(at_frame, Boxes):
                return scene_from_boxes(bev, at_frame, frame.world_from_ego), ()
            return scene_from_tracks(bev, at_frame, frame.world_from_ego), source.tracks

        # The value keeps map and tracks in memory: while it is kept, no other object has their identity.
        return self._scenes.get((recording.key, place, source.kind, id(bev), id(source.tracks)), build)[0]

    def _items(
        self, recording: Recording, place: Place, source: SceneVehicles, scene: SceneModel
    ) -> list[dict[str, Any]]:
        """Return the vehicles and people of a scene model with their trails."""
        ego_from_world = inverse(scene.world_from_ego)
        trails: dict[str, list[list[float]]] = {}
        for k in range(max(place.frame - _TRAIL, 0), place.frame + 1):
            for key, at in _positions(recording, place, source, k).items():
                xy = apply(ego_from_world, at[:3])[:2]
                trails.setdefault(key, []).append([round(float(v), 2) for v in xy])
        tracks = {f"track {one.id}": one for one in source.tracks[place.frame]} if source.tracks else {}
        bottoms_m = {key: float(apply(ego_from_world, one.position_world_m)[2]) for key, one in tracks.items()}
        if source.kind == "boxes":
            boxes = recording.frame(place.scene, place.frame).boxes_ego or Boxes.empty()
            bottoms_m = dict(zip(boxes.instance, _bottoms_m(boxes), strict=True))
        return [
            _item(item, scene, trails.get(item.id, []), tracks.get(item.id), bottoms_m.get(item.id, 0.0))
            for item in (*scene.objects, *scene.others)
        ]

    def path(self, recording: Recording, place: Place, vehicle: str) -> dict[str, Any]:
        """Return the path of a vehicle around a key frame in the world frame: frame, x, y, z, speed; may be empty."""
        source, _ = self.vehicles(recording, place)
        last = len(recording.samples(place.scene))
        points = []
        for k in range(max(place.frame - _PATH, 0), min(place.frame + _PATH + 1, last)):
            at = _positions(recording, place, source, k).get(vehicle)
            if at is not None:
                points.append([k, *(None if not np.isfinite(v) else round(float(v), 3) for v in at)])
        return {"id": vehicle, "points": points}


def _positions(recording: Recording, place: Place, source: SceneVehicles, k: int) -> dict[str, FloatArray]:
    """Return (4,) the place x, y, z in the world and the speed of each vehicle of frame `k`, by its id."""
    if source.kind == "tracks":
        return {f"track {one.id}": np.append(one.position_world_m, one.speed_mps) for one in source.tracks[k]}
    if source.kind == "map":
        return {}
    frame = recording.frame(place.scene, k)
    boxes = frame.boxes_ego or Boxes.empty()
    centres = apply(frame.world_from_ego, boxes.centre_m)
    speeds = np.hypot(*boxes.velocity_mps.T)
    return {key: np.append(centre, speed) for key, centre, speed in zip(boxes.instance, centres, speeds, strict=True)}


def _bottoms_m(boxes: Boxes) -> list[float]:
    """Return the height of the lower side of each box."""
    return [float(z) for z in boxes.centre_m[:, 2] - boxes.size_wlh_m[:, 2] / 2]


def _item(
    item: SceneObject, scene: SceneModel, trail: list[list[float]], track: Track | None, bottom_m: float
) -> dict[str, Any]:
    height_m = item.height_m or (track.height_m if track is not None else None)
    if height_m is None or not np.isfinite(height_m):
        height_m = HEIGHT_M.get(item.category, HEIGHT_M["car"])
    return {
        "id": item.id,
        "name": item.common_name,
        "words": describe_object(item, scene),
        "colour": scene.colour_name(item),
        "rgb": None if item.rgb is None else [round(float(v)) for v in item.rgb],
        "xy": [round(float(v), 3) for v in item.centre_m],
        "yaw": round(item.yaw_rad, 4),
        "front_known": item.front_known,
        "size": [round(item.length_m, 2), round(item.width_m, 2), round(float(height_m), 2)],
        "bottom": round(bottom_m, 2),
        "speed": None if item.speed_mps is None else round(item.speed_mps, 2),
        "distance": round(item.distance_m(scene.ego), 1),
        "score": None if track is None else round(track.score, 3),
        "seen": True if track is None else track.seen,
        "trail": trail,
    }


def _camera(camera: Camera) -> dict[str, Any]:
    return {
        "size": [camera.width_px, camera.height_px],
        "intrinsic": _rounded(camera.intrinsic),
        "cam_from_ego": _rounded(inverse(camera.ego_from_cam)),
    }


def _boxes(frame: Frame) -> list[dict[str, Any]]:
    """Return the annotated boxes in the ego frame."""
    boxes = frame.boxes_ego or Boxes.empty()
    bottoms_m = _bottoms_m(boxes)
    return [
        {
            "name": boxes.category[i],
            "xy": [round(float(v), 3) for v in boxes.centre_m[i, :2]],
            "yaw": round(float(boxes.yaw_rad[i]), 4),
            "size": [round(float(boxes.size_wlh_m[i, axis]), 2) for axis in (1, 0, 2)],
            "bottom": round(bottoms_m[i], 2),
        }
        for i in range(len(boxes))
    ]


def _ego(frame: Frame) -> dict[str, float]:
    ego = frame.rig.ego_vehicle
    return {"length": ego.length_m, "width": ego.width_m, "rear": ego.rear_overhang_m}


def _map(bev: BEVMap) -> dict[str, Any]:
    grid = bev.grid
    return {
        "x": [grid.x_min_m, grid.x_max_m],
        "y": [grid.y_min_m, grid.y_max_m],
        "cell": grid.cell_m,
        "shape": list(grid.shape),
        "predicted": bev.thresholds is not None,
        "true": bev.is_truth,
    }


def _rounded(matrix: FloatArray) -> list[list[float]]:
    return [[round(float(v), 6) for v in row] for row in matrix]
