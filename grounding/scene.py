"""What stands around the ego: vehicles with place, size, heading and the colour that the map says."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from appocc.bevmap import VEHICLE, BEVMap
from appocc.boxes import Boxes
from appocc.checks import BoolArray, FloatArray, check_shape, check_transform, frozen
from appocc.colours import Exposure, exposure_of, name
from appocc.drawing import EGO_LENGTH_M, EGO_REAR_M
from appocc.geometry import apply, footprints, yaw_of
from tracking.blobs import Blobs, find_blobs

# From the ego's origin (rear axle) to the centre of its footprint, along its heading.
EGO_CENTRE_M = EGO_LENGTH_M / 2 - EGO_REAR_M


@dataclass(frozen=True)
class SceneObject:
    """A vehicle on the grid, in the ego frame.

    Attributes:
        id: instance token of an annotated vehicle, or "blob N".
        category: nuScenes category, '' where only its shape is known.
        centre_m: (2,) centre of its footprint.
        yaw_rad: direction of its long axis; its heading where the front is known.
        front_known: whether `yaw_rad` points to its front.
        length_m: size along its heading.
        width_m: size across.
        height_m: size upwards, None where unknown.
        velocity_mps: (2,) over ground along the ego's axes, None where unknown.
        rgb: (3,) sRGB 0..255 of its cells in the map, None where the map knows no colour.
    """

    id: str
    category: str
    centre_m: FloatArray
    yaw_rad: float
    front_known: bool
    length_m: float
    width_m: float
    height_m: float | None = None
    velocity_mps: FloatArray | None = None
    rgb: FloatArray | None = None

    def __post_init__(self) -> None:
        """Check shapes.

        Raises:
            ShapeError: if one does not fit.
        """
        for name_, array, size in (
            ("centre_m", self.centre_m, 2),
            ("velocity_mps", self.velocity_mps, 2),
            ("rgb", self.rgb, 3),
        ):
            if array is not None:
                check_shape(f"object {name_}", array, (size,))
                frozen(array)

    @property
    def speed_mps(self) -> float | None:
        """Speed over ground, None where unknown."""
        return None if self.velocity_mps is None else float(np.hypot(*self.velocity_mps))

    @property
    def distance_m(self) -> float:
        """From the middle of the ego to the middle of the vehicle."""
        return float(np.hypot(self.centre_m[0] - EGO_CENTRE_M, self.centre_m[1]))

    def footprint(self) -> FloatArray:
        """Corners (4, 2) in the ego frame."""
        return footprints(self.centre_m, self.yaw_rad, [self.length_m, self.width_m])

    def covers(self, xy_m: FloatArray, margin_m: float = 0.0) -> BoolArray:
        """Whether points (..., 2) lie in the footprint, grown on all sides by a margin."""
        offset = xy_m - self.centre_m
        cos, sin = np.cos(self.yaw_rad), np.sin(self.yaw_rad)
        along, across = offset[..., 0] * cos + offset[..., 1] * sin, offset[..., 1] * cos - offset[..., 0] * sin
        half = np.array([self.length_m, self.width_m]) / 2 + margin_m
        return np.asarray((np.abs(along) <= half[0]) & (np.abs(across) <= half[1]))

    @property
    def noun(self) -> str:
        """The plain word for its class."""
        last = self.category.removeprefix("vehicle.").split(".")
        plain = {"construction": "construction vehicle", "emergency": last[-1], "other_vehicle": "vehicle"}
        return plain.get(last[0], last[0]) or "vehicle"


@dataclass(frozen=True)
class Scene:
    """A map and the vehicles on it.

    Attributes:
        bev: the colour map of the moment.
        objects: vehicles whose centre lies on the grid.
        world_from_ego: (4, 4) pose of the ego.
    """

    bev: BEVMap
    objects: tuple[SceneObject, ...]
    world_from_ego: FloatArray

    def __post_init__(self) -> None:
        """Check the pose.

        Raises:
            ShapeError: if it is no rigid transform.
        """
        check_transform("world_from_ego", self.world_from_ego)

    @cached_property
    def exposure(self) -> Exposure:
        """The light of the scene, by its road and its vehicles."""
        colours = [item.rgb for item in self.objects if item.rgb is not None]
        return exposure_of(self.bev, np.array(colours).reshape(-1, 3))

    def colour_name(self, item: SceneObject) -> str | None:
        """The likeliest colour word of a vehicle, None where its colour is unknown."""
        return None if item.rgb is None else name(item.rgb, self.exposure)

    def world_xy(self, xy_m: ArrayLike) -> FloatArray:
        """A point (2,) on the ego's ground plane, in the world."""
        return apply(self.world_from_ego, np.append(np.asarray(xy_m, dtype=np.float64), 0.0))[:2]

    def world_heading(self, heading_ego_rad: float) -> float:
        """A heading in the ego frame, in the world."""
        cos, sin = np.cos(heading_ego_rad), np.sin(heading_ego_rad)
        turn = np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]])
        return float(yaw_of(self.world_from_ego[:3, :3] @ turn))


def scene_of(bev: BEVMap, boxes_ego: Boxes | None, world_from_ego: FloatArray) -> Scene:
    """The scene of annotated boxes in the ego frame, or, where they are None, of the map's own vehicle blobs."""
    objects = _from_blobs(find_blobs(bev)) if boxes_ego is None else _from_boxes(bev, boxes_ego.vehicles())
    return Scene(bev, tuple(item for item in objects if _on_grid(bev, item) and not _is_ego(item)), world_from_ego)


def _on_grid(bev: BEVMap, item: SceneObject) -> bool:
    return bool(bev.grid.contains(bev.grid.cell_of(item.centre_m)))


def _is_ego(item: SceneObject) -> bool:
    """Whether a vehicle of a predicted map is the ego itself."""
    return bool(item.covers(np.array([EGO_CENTRE_M, 0.0])))


def _from_boxes(bev: BEVMap, boxes: Boxes) -> list[SceneObject]:
    """Annotated vehicles, with colours from the map and never from an annotation."""
    known = bev.on[VEHICLE] & bev.appearance_valid
    centres, colours = bev.grid.centres()[known], np.moveaxis(bev.appearance, 0, -1)[known]
    objects = []
    for i in range(len(boxes)):
        width, length, height = (float(size) for size in boxes.size_wlh_m[i])
        velocity = boxes.velocity_mps[i]
        bare = SceneObject(
            boxes.instance[i],
            boxes.category[i],
            boxes.centre_m[i, :2].copy(),
            float(boxes.yaw_rad[i]),
            True,
            length,
            width,
            height,
            velocity.copy() if np.isfinite(velocity).all() else None,
        )
        own = colours[bare.covers(centres)]
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
