"""Scene model: a map and the objects on it, built from annotated boxes, tracks or the map alone."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from appocc.bevmap import VEHICLE, BEVMap
from appocc.boxes import Boxes, is_person_or_bicycle, is_vehicle
from appocc.checks import FloatArray, check_transform, frozen
from appocc.colours import Exposure, gains_of, name, names
from appocc.ego_vehicle import EgoVehicle
from appocc.errors import AppoccError
from appocc.geometry import apply, inverse, wrap_angle, yaw_of
from appocc.objects import BEVObjects
from appocc.srgb import encode_srgb, linear_from_srgb
from grounding.referent.object_table import ObjectTable
from grounding.road.landmarks import NO_LANDMARKS, Landmarks
from grounding.road.lane_model import LANE_M, LaneModel
from grounding.road.pose import Pose2D
from grounding.road.road_map import RoadMap
from grounding.road.style import DEFAULT_STYLE, DrivingStyle
from grounding.road.visibility import unseen_sides
from grounding.scene_object import SceneObject
from tracking.instances.instances import Instances, find_instances
from tracking.tracks import Track

__all__ = ["SceneModel", "SceneObject", "scene_from_boxes", "scene_from_map", "scene_from_tracks"]

# Range of objects where there is no map.
_MAX_RANGE_M = 100.0
# White light of unit gain, with default specular reflection and spread.
NEUTRAL_LIGHT = Exposure(np.ones(3))
# Vehicles in a row share their heading: length of a row to either side, and largest angle between its vehicles.
_ROW_M, _PARALLEL_RAD = 20.0, 0.26


@dataclass(frozen=True, eq=False)
class SceneModel:
    """The map and the objects of one moment, in the ego frame.

    Attributes:
        bev: colour map; None if only objects are known.
        objects: vehicles within the grid.
        world_from_ego: (4, 4) pose of the ego.
        others: people and bicycles, which the cells of maps do not show.
        ego: size of the ego vehicle.
        left_hand_traffic: whether traffic drives on the left; None: as oncoming vehicles do, else on the right.
        landmarks: crossings, stop lines and the like of a vector map.
        style: gaps that the ego keeps.
        speed_mps: of the ego, forwards; None: unknown.
    """

    bev: BEVMap | None
    objects: tuple[SceneObject, ...]
    world_from_ego: FloatArray
    others: tuple[SceneObject, ...] = ()
    ego: EgoVehicle = EgoVehicle()
    left_hand_traffic: bool | None = None
    landmarks: Landmarks = NO_LANDMARKS
    style: DrivingStyle = DEFAULT_STYLE
    speed_mps: float | None = None

    def __post_init__(self) -> None:
        """Check the pose and keep a read-only copy of it.

        Raises:
            ShapeError: if `world_from_ego` is not a rigid transform.
        """
        check_transform("world_from_ego", self.world_from_ego)
        pose = self.world_from_ego.copy()
        frozen(pose)
        object.__setattr__(self, "world_from_ego", pose)

    @cached_property
    def table(self) -> ObjectTable:
        """Vehicles, then people and bicycles, as arrays."""
        return ObjectTable.from_objects(
            (*self.objects, *self.others), len(self.objects), self.bev, self.road, self.ego
        )

    @cached_property
    def road(self) -> RoadMap | None:
        """Road model of the map; None without a map."""
        return None if self.bev is None else self.road_from(None)

    def road_from(self, start: Pose2D | None) -> RoadMap:
        """Return the road model as it is from a pose of the ego, None for its present one.

        Raises:
            AppoccError: without a map.
        """
        if self.bev is None:
            raise AppoccError("scene: expected a map, there are objects only")
        lane = self.road.ego_lane if start is not None and self.road is not None else None
        road = RoadMap.from_map(
            self.bev, self.objects, self.ego, start, self.left_hand_traffic, self.landmarks, self.style, lane
        )
        return road if start is not None else replace(road, speed_mps=self.speed_mps)

    def seen_from(self, pose: Pose2D) -> SceneModel:
        """Return the objects as they are seen from another pose of the ego, without the map and its landmarks."""
        paint = dict(zip((*self.objects, *self.others), self.paint_rgb, strict=True))
        cos, sin = pose.ahead
        turn, origin = np.array([[cos, sin], [-sin, cos]]), pose.xy_m - self.ego.centre_m * pose.ahead

        def moved(item: SceneObject) -> SceneObject:
            return replace(
                item,
                centre_m=turn @ (item.centre_m - origin),
                yaw_rad=float(wrap_angle(item.yaw_rad - pose.heading_rad)),
                velocity_mps=None if item.velocity_mps is None else turn @ item.velocity_mps,
                rgb=paint[item] if np.isfinite(paint[item]).all() else None,
            )

        objects, others = (tuple(map(moved, items)) for items in (self.objects, self.others))
        return replace(self, bev=None, objects=objects, others=others, landmarks=NO_LANDMARKS)

    @cached_property
    def unseen_sides(self) -> tuple[str, ...]:
        """Sides of the ego that no camera sees, such as "behind us"."""
        return () if self.bev is None else tuple(unseen_sides(self.bev, self.ego))

    @property
    def lanes(self) -> LaneModel:
        """Lane model of the road."""
        return self.table.lanes

    @cached_property
    def paint_rgb(self) -> FloatArray:
        """(N, 3) sRGB of the objects of the table under neutral light, may exceed 255; NaN where unknown.

        Illumination is estimated from the road next to each object. Without a map colours are not corrected.
        """
        # Not by the table: that needs the road model, which takes far longer than the colours.
        items = (*self.objects, *self.others)
        rgb = np.array([np.full(3, np.nan) if item.rgb is None else item.rgb for item in items]).reshape(-1, 3)
        known = np.flatnonzero(np.isfinite(rgb).all(axis=1))
        if self.bev is None or not len(known):
            return rgb
        gains = gains_of(self.bev, rgb[known], np.stack([items[i].footprint() for i in known]))
        neutral = np.full_like(rgb, np.nan)
        neutral[known] = 255 * encode_srgb(linear_from_srgb(rgb[known]) * gains)
        return neutral

    def colour_name(self, item: SceneObject) -> str | None:
        """Return the most probable colour word of an object; None if its colour is unknown."""
        if item.rgb is None:
            return None
        return self._colour_names.get(item) or name(item.rgb, NEUTRAL_LIGHT)

    @cached_property
    def _colour_names(self) -> dict[SceneObject, str]:
        """Colour words of all objects; naming them together takes as long as naming one."""
        return dict(zip((*self.objects, *self.others), names(self.paint_rgb, NEUTRAL_LIGHT), strict=True))

    def world_xy(self, xy_m: ArrayLike) -> FloatArray:
        """Transform a point (2,) on the ground plane from the ego frame to the world frame."""
        return apply(self.world_from_ego, np.append(np.asarray(xy_m, dtype=np.float64), 0.0))[:2]

    def world_heading(self, heading_ego_rad: float) -> float:
        """Transform a heading from the ego frame to the world frame."""
        cos, sin = np.cos(heading_ego_rad), np.sin(heading_ego_rad)
        turn = np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]])
        return float(yaw_of(self.world_from_ego[:3, :3] @ turn))


def scene_from_map(bev: BEVMap, world_from_ego: FloatArray, ego: EgoVehicle = EgoVehicle()) -> SceneModel:
    """Build the scene of a map and its own detected objects, or vehicle instances if it has no objects."""
    objects = bev.detected_objects
    items = _from_instances(find_instances(bev)) if objects is None else _from_objects(objects)
    return _build_scene(bev, items, world_from_ego, ego)


def scene_from_boxes(
    bev: BEVMap | None, boxes_ego: Boxes, world_from_ego: FloatArray, ego: EgoVehicle = EgoVehicle()
) -> SceneModel:
    """Build the scene of annotated boxes in the ego frame, with colours from the map."""
    return _build_scene(bev, _from_boxes(bev, boxes_ego), world_from_ego, ego)


def scene_from_tracks(
    bev: BEVMap | None,
    tracks: Iterable[Track],
    world_from_ego: FloatArray,
    before: Iterable[Track] | None = None,
    seconds: float = 0.5,
    ego: EgoVehicle = EgoVehicle(),
) -> SceneModel:
    """Build the scene of tracks in the world frame.

    The unknown front of a vehicle is taken from the vehicles in the same row, if these agree.

    Args:
        bev: map; None without one.
        tracks: tracks of the moment.
        world_from_ego: (4, 4) pose of the ego.
        before: earlier tracks, from which yaw rates and accelerations are computed; None without them.
        seconds: time since `before`.
        ego: size of the ego vehicle.
    """
    earlier = None if before is None else {track.id: track for track in before}
    ego_from_world = inverse(world_from_ego)
    items = [_from_track(track, ego_from_world, earlier, seconds) for track in tracks]
    scene = _build_scene(bev, items, world_from_ego, ego)
    return replace(scene, objects=_with_row_headings(scene.objects))


def _build_scene(
    bev: BEVMap | None, items: Sequence[SceneObject], world_from_ego: FloatArray, ego: EgoVehicle
) -> SceneModel:
    """Build a scene of the objects in range, vehicles separate from people and bicycles."""
    inside = [item for item in items if _is_in_range(bev, item, ego) and not _is_ego(item, ego)]
    vehicles = tuple(item for item in inside if not is_person_or_bicycle(item.category))
    others = tuple(item for item in inside if is_person_or_bicycle(item.category))
    return SceneModel(bev, vehicles, world_from_ego, others, ego)


def _is_in_range(bev: BEVMap | None, item: SceneObject, ego: EgoVehicle) -> bool:
    """Return whether an object is on a cell of the map that a camera sees; without a map, whether it is in range."""
    if bev is None:
        return item.distance_m(ego) <= _MAX_RANGE_M
    cell = bev.grid.cell_of(item.centre_m)
    return bool(bev.grid.contains(cell)) and not bev.unseen[tuple(cell)]


def _is_ego(item: SceneObject, ego: EgoVehicle) -> bool:
    """Return whether an instance of a predicted map is the ego itself."""
    return bool(item.covers(np.array([ego.centre_m, 0.0])))


def _from_boxes(bev: BEVMap | None, boxes: Boxes) -> list[SceneObject]:
    """Convert annotated vehicles, people and bicycles.

    Colours come from the map only; those of people and bicycles from cells that no vehicle covers.
    """
    centres, colours = np.zeros((0, 2)), np.zeros((0, 3))
    if bev is not None:
        known = bev.on[VEHICLE] & bev.appearance_valid
        centres, colours = bev.grid.centres()[known], np.moveaxis(bev.appearance, 0, -1)[known].astype(np.float64)
    objects = []
    free = np.ones(len(centres), np.bool_)
    known_kinds = [i for i, one in enumerate(boxes.category) if is_vehicle(one) or is_person_or_bicycle(one)]
    for i in sorted(known_kinds, key=lambda i: not is_vehicle(boxes.category[i])):  # vehicles first
        width, length, height = (float(size) for size in boxes.size_wlh_m[i])
        velocity = boxes.velocity_mps[i]
        bare = SceneObject(
            id=boxes.instance[i],
            category=boxes.category[i],
            centre_m=boxes.centre_m[i, :2],
            yaw_rad=float(boxes.yaw_rad[i]),
            front_known=True,
            length_m=length,
            width_m=width,
            height_m=height,
            velocity_mps=velocity if np.isfinite(velocity).all() else None,
        )
        covered = bare.covers(centres)
        if is_vehicle(bare.category):
            free &= ~covered
        else:
            covered &= free
        own = colours[covered]
        objects.append(replace(bare, rgb=np.median(own, axis=0)) if len(own) else bare)
    return objects


def _from_instances(instances: Instances) -> list[SceneObject]:
    """Convert the instances of a map; their class, speed and front are unknown."""
    return [
        SceneObject(
            id=f"blob {i}",
            category="",
            centre_m=instances.centroid_m[i],
            yaw_rad=float(instances.yaw_rad[i]),
            front_known=False,
            length_m=float(instances.length_m[i]),
            width_m=float(instances.width_m[i]),
            rgb=instances.rgb[i] if np.isfinite(instances.rgb[i]).all() else None,
        )
        for i in range(len(instances))
    ]


def _from_objects(objects: BEVObjects) -> list[SceneObject]:
    """Convert the objects of a map; people and bicycles have no paint.

    The class car includes vans (nuScenes), so that its size decides.
    """
    known_velocity = np.asarray(np.isfinite(objects.velocity_mps).all(axis=1))
    return [
        SceneObject(
            id=f"object {i}",
            category="" if objects.kind[i] == "car" else objects.kind[i],
            centre_m=objects.centre_m[i, :2],
            yaw_rad=float(objects.yaw_rad[i]),
            front_known=True,
            length_m=float(objects.size_wlh_m[i, 1]),
            width_m=float(objects.size_wlh_m[i, 0]),
            height_m=float(objects.size_wlh_m[i, 2]),
            velocity_mps=objects.velocity_mps[i] if known_velocity[i] else None,
            rgb=objects.rgb[i] if vehicle and np.isfinite(objects.rgb[i]).all() else None,
        )
        for i, vehicle in enumerate(objects.are_vehicles.tolist())
    ]


def _from_track(
    track: Track, ego_from_world: FloatArray, earlier: dict[int, Track] | None, seconds: float
) -> SceneObject:
    """Convert a track to the ego frame; an earlier state of it gives its yaw rate and acceleration."""
    rotation = ego_from_world[:2, :2]
    velocity: FloatArray | None = rotation @ track.velocity_world_mps
    yaw = float(wrap_angle(track.yaw_world_rad + yaw_of(ego_from_world[:3, :3])))
    if track.moving and not track.heading_known:
        yaw = _align_with_motion(yaw, rotation @ track.velocity_world_mps)
    previous = None if earlier is None else earlier.get(track.id)
    if not track.moving:
        velocity = np.zeros(2) if track.velocity_known else None
    return SceneObject(
        id=f"track {track.id}",
        category="" if track.kind == "vehicle" else track.kind,
        centre_m=apply(ego_from_world, track.position_world_m)[:2],
        yaw_rad=yaw,
        front_known=track.heading_known or track.moving,
        length_m=track.length_m,
        width_m=track.width_m,
        height_m=track.height_m if np.isfinite(track.height_m) else None,
        velocity_mps=velocity,
        rgb=track.rgb if np.isfinite(track.rgb).all() else None,
        yaw_rate_radps=None if previous is None else _turned_rad(previous, track) / seconds,
        acceleration_mps2=None if previous is None else (track.speed_mps - previous.speed_mps) / seconds,
    )


def _turned_rad(previous: Track, track: Track) -> float:
    return float(wrap_angle(track.yaw_world_rad - previous.yaw_world_rad))


def _align_with_motion(yaw_rad: float, velocity_mps: FloatArray) -> float:
    """Return the direction of an axis that points along the velocity."""
    forward = np.cos(yaw_rad) * velocity_mps[0] + np.sin(yaw_rad) * velocity_mps[1] >= 0
    return yaw_rad if forward else float(wrap_angle(yaw_rad + np.pi))


def _with_row_headings(objects: Sequence[SceneObject]) -> tuple[SceneObject, ...]:
    """Set the unknown headings of vehicles to those of the vehicles in the same row."""
    known = [item for item in objects if item.front_known]
    xy, yaw = np.array([item.centre_m for item in known]).reshape(-1, 2), np.array([item.yaw_rad for item in known])
    result = list(objects)
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
            result[i] = replace(item, yaw_rad=heading, front_known=True)
    return tuple(result)
