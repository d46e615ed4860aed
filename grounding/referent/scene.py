"""What stands around the ego: vehicles with place, size, heading and the colour that the map says."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from appocc.bevmap import VEHICLE, BEVMap
from appocc.boxes import Boxes, is_person_or_bicycle, is_vehicle
from appocc.checks import FloatArray, check_transform
from appocc.colours import Exposure, gains_of, name, names
from appocc.geometry import apply, inverse, wrap_angle, yaw_of
from appocc.srgb import encode_srgb, linear_from_srgb
from grounding.referent.object_table import Crowd, crowd_of
from grounding.road.lane_model import LANE_M, Lanes
from grounding.road.road_map import Road
from grounding.road.visibility import unseen_sides
from grounding.scene_object import EGO_CENTRE_M, SceneObject
from tracking.instances.instances import Blobs, find_blobs
from tracking.tracks import Track

__all__ = ["EGO_CENTRE_M", "Scene", "SceneObject", "scene_of", "scene_of_tracks"]

# Without a map vehicles count up to this distance.
_FARTHEST_M = 100.0
# Light that needs no factors; what varnish mirrors, and how light strays, is as usual.
NEUTRAL = Exposure(np.ones(3))
# A track that certainly does not move, and is slower than this, stands.
_STANDS_MPS = 1.0
# Vehicles that stand in one row head the same way: so near along the row, and parallel within this angle.
_ROW_M, _PARALLEL_RAD = 20.0, 0.26


@dataclass(frozen=True)
class Scene:
    """A map and the vehicles on it.

    Attributes:
        bev: the colour map of the moment; None where vehicles are known without one.
        objects: vehicles whose centre lies on the grid.
        world_from_ego: (4, 4) pose of the ego.
        others: people and bicycles; a map shows none.
    """

    bev: BEVMap | None
    objects: tuple[SceneObject, ...]
    world_from_ego: FloatArray
    others: tuple[SceneObject, ...] = ()

    def __post_init__(self) -> None:
        """Check the pose.

        Raises:
            ShapeError: if it is no rigid transform.
        """
        check_transform("world_from_ego", self.world_from_ego)

    @cached_property
    def crowd(self) -> Crowd:
        """Vehicles, people and bicycles as arrays, in this order."""
        return crowd_of((*self.objects, *self.others), len(self.objects), self.bev, self.road)

    @cached_property
    def road(self) -> Road | None:
        """What the map says about driving, made once; None without a map."""
        return None if self.bev is None else Road.of(self.bev, self.objects)

    @cached_property
    def unseen_sides(self) -> tuple[str, ...]:
        """The sides of the ego that no camera sees, such as "behind us"."""
        return () if self.bev is None else tuple(unseen_sides(self.bev))

    @property
    def lanes(self) -> Lanes:
        """The course of the road."""
        return self.crowd.lanes

    @cached_property
    def paint_rgb(self) -> FloatArray:
        """(N, 3) sRGB of all things of the crowd in neutral light, may be above 255; NaN where unknown.

        Shade, sun and lamps are told by the road of the map beside each. Without a map colours stay as they are.
        """
        rgb = self.crowd.rgb
        known = np.flatnonzero(np.isfinite(rgb).all(axis=1))
        if self.bev is None or not len(known):
            return rgb
        gains = gains_of(self.bev, rgb[known], self.crowd.corners_m[known])
        neutral = np.full_like(rgb, np.nan)
        neutral[known] = 255 * encode_srgb(linear_from_srgb(rgb[known]) * gains)
        return neutral

    def colour_name(self, item: SceneObject) -> str | None:
        """The likeliest colour word of a vehicle, None where its colour is unknown."""
        if item.rgb is None:
            return None
        return self._names.get(id(item)) or name(item.rgb, NEUTRAL)

    @cached_property
    def _names(self) -> dict[int, str]:
        """Colour words by the identity of the object: of all at once they are as fast as of one."""
        return dict(zip(map(id, self.crowd.items), names(self.paint_rgb, NEUTRAL), strict=True))

    def world_xy(self, xy_m: ArrayLike) -> FloatArray:
        """A point (2,) on the ego's ground plane, in the world."""
        return apply(self.world_from_ego, np.append(np.asarray(xy_m, dtype=np.float64), 0.0))[:2]

    def world_heading(self, heading_ego_rad: float) -> float:
        """A heading in the ego frame, in the world."""
        cos, sin = np.cos(heading_ego_rad), np.sin(heading_ego_rad)
        turn = np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]])
        return float(yaw_of(self.world_from_ego[:3, :3] @ turn))


def scene_of(bev: BEVMap | None, boxes_ego: Boxes | None, world_from_ego: FloatArray) -> Scene:
    """The scene of annotated boxes in the ego frame, or, where they are None, of the map's own vehicle blobs."""
    if boxes_ego is None:
        return _scene(bev, [] if bev is None else _from_blobs(find_blobs(bev)), world_from_ego)
    return _scene(bev, _from_boxes(bev, boxes_ego), world_from_ego)


def scene_of_tracks(
    bev: BEVMap | None,
    tracks: Iterable[Track],
    world_from_ego: FloatArray,
    before: Iterable[Track] | None = None,
    seconds: float = 0.5,
) -> Scene:
    """The scene of tracks, with their motion; of `before`, the tracks so many seconds ago, also with its changes.

    A front that motion has not told is taken from the vehicles that stand in the same row, where those agree.
    """
    earlier = None if before is None else {track.id: track for track in before}
    ego_from_world = inverse(world_from_ego)
    items = [_from_track(track, ego_from_world, earlier, seconds) for track in tracks]
    scene = _scene(bev, items, world_from_ego)
    return replace(scene, objects=_fronts_of_rows(scene.objects))


def _scene(bev: BEVMap | None, items: Sequence[SceneObject], world_from_ego: FloatArray) -> Scene:
    """Those within reach, vehicles apart from the others."""
    inside = [item for item in items if _within(bev, item) and not _is_ego(item)]
    vehicles = tuple(item for item in inside if not is_person_or_bicycle(item.category))
    others = tuple(item for item in inside if is_person_or_bicycle(item.category))
    return Scene(bev, vehicles, world_from_ego, others)


def _within(bev: BEVMap | None, item: SceneObject) -> bool:
    """Whether a thing is near enough, on the map where there is one; what no camera sees is not known to be there."""
    if bev is None:
        return item.distance_m <= _FARTHEST_M
    cell = bev.grid.cell_of(item.centre_m)
    return bool(bev.grid.contains(cell)) and not bev.unseen[tuple(cell)]


def _is_ego(item: SceneObject) -> bool:
    """Whether a vehicle of a predicted map is the ego itself."""
    return bool(item.covers(np.array([EGO_CENTRE_M, 0.0])))


def _from_boxes(bev: BEVMap | None, boxes: Boxes) -> list[SceneObject]:
    """Annotated vehicles, people and bicycles, with colours from the map and never from an annotation."""
    centres, colours = np.zeros((0, 2)), np.zeros((0, 3))
    if bev is not None:
        known = bev.on[VEHICLE] & bev.appearance_valid
        centres, colours = bev.grid.centres()[known], np.moveaxis(bev.appearance, 0, -1)[known].astype(np.float64)
    objects = []
    for i, category in enumerate(boxes.category):
        if not (is_vehicle(category) or is_person_or_bicycle(category)):
            continue
        width, length, height = (float(size) for size in boxes.size_wlh_m[i])
        velocity = boxes.velocity_mps[i]
        bare = SceneObject(
            boxes.instance[i],
            category,
            boxes.centre_m[i, :2].copy(),
            float(boxes.yaw_rad[i]),
            True,
            length,
            width,
            height,
            velocity.copy() if np.isfinite(velocity).all() else None,
        )
        own = colours[bare.covers(centres)] if is_vehicle(category) else colours[:0]
        objects.append(replace(bare, rgb=np.median(own, axis=0)) if len(own) else bare)
    return objects


def _from_blobs(blobs: Blobs) -> list[SceneObject]:
    """The map's own vehicles: no class, no speed, and a front that is not known."""
    return [
        SceneObject(
            f"blob {i}",
            "",
            blobs.centroid_m[i].copy(),
            float(blobs.yaw_rad[i]),
            False,
            float(blobs.length_m[i]),
            float(blobs.width_m[i]),
            rgb=blobs.rgb[i].copy() if np.isfinite(blobs.rgb[i]).all() else None,
        )
        for i in range(len(blobs))
    ]


def _from_track(
    track: Track, ego_from_world: FloatArray, earlier: dict[int, Track] | None, seconds: float
) -> SceneObject:
    rotation = ego_from_world[:2, :2]
    velocity: FloatArray | None = rotation @ track.velocity_world_mps
    yaw = float(wrap_angle(track.yaw_world_rad + yaw_of(ego_from_world[:3, :3])))
    if track.moving and not track.heading_known:
        yaw = _forward(yaw, rotation @ track.velocity_world_mps)
    previous = None if earlier is None else earlier.get(track.id)
    if not track.moving:
        # What was seen only once may move at any speed.
        unsure = track.speed_mps > _STANDS_MPS or (earlier is not None and previous is None)
        velocity = None if unsure else np.zeros(2)
    return SceneObject(
        f"track {track.id}",
        "" if track.kind == "vehicle" else track.kind,
        apply(ego_from_world, track.position_world_m)[:2],
        yaw,
        track.heading_known or track.moving,
        track.length_m,
        track.width_m,
        track.height_m if np.isfinite(track.height_m) else None,
        velocity,
        track.rgb.copy() if np.isfinite(track.rgb).all() else None,
        None if previous is None else float(wrap_angle(track.yaw_world_rad - previous.yaw_world_rad)) / seconds,
        None if previous is None else (track.speed_mps - previous.speed_mps) / seconds,
    )


def _forward(yaw_rad: float, velocity_mps: FloatArray) -> float:
    """The end of an axis that points where a vehicle goes."""
    goes_on = np.cos(yaw_rad) * velocity_mps[0] + np.sin(yaw_rad) * velocity_mps[1] >= 0
    return yaw_rad if goes_on else float(wrap_angle(yaw_rad + np.pi))


def _fronts_of_rows(objects: Sequence[SceneObject]) -> tuple[SceneObject, ...]:
    """Vehicles with the fronts that others in their rows tell."""
    known = [item for item in objects if item.front_known]
    xy, yaw = np.array([item.centre_m for item in known]).reshape(-1, 2), np.array([item.yaw_rad for item in known])
    told = list(objects)
    for i, item in enumerate(objects):
        if item.front_known:
            continue
        cos, sin = np.cos(item.yaw_rad), np.sin(item.yaw_rad)
        x, y = (xy - item.centre_m).T
        row = (np.abs(x * cos + y * sin) < _ROW_M) & (np.abs(y * cos - x * sin) < LANE_M / 2)
        turn = np.abs(wrap_angle(yaw[row] - item.yaw_rad))
        same, opposite = turn < _PARALLEL_RAD, turn > np.pi - _PARALLEL_RAD
        if same.any() != opposite.any():
            heading = item.yaw_rad if same.any() else float(wrap_angle(item.yaw_rad + np.pi))
            told[i] = replace(item, yaw_rad=heading, front_known=True)
    return tuple(told)
