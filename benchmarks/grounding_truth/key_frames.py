"""True content of a key frame of a simulated dataset, and the admissible goals in it.

Plain geometry on the exact map and the true boxes, without code of `grounding`, which is evaluated with it. A place
is the cell of the centre of the ego's footprint. It is admissible if the relation holds within its limits, the
footprint is on known road and 0.2 m clear of vehicles at some heading within 30 degrees of those of the lane, and a
disc of the ego's width can be moved there over free road. Ego frame: x forward, y left, metres.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy import ndimage

from appocc.bevmap import ROAD, VEHICLE, BEVMap, bev_path, load_map
from appocc.boxes import Boxes, is_vehicle
from appocc.checks import BoolArray, FloatArray, IntArray
from appocc.errors import DataError
from appocc.evaluation.vehicles import visibility_levels
from appocc.files import read_json, zip_arrays
from appocc.geometry import inverse, wrap_angle
from appocc.nuscenes import Dataset
from appocc.nuscenes.maps import VectorMap, vector_map
from appocc.nuscenes.records import Sample
from benchmarks.grounding_truth.roads import EGO, Lane, is_street, own_path

HIDDEN = "v0-40"
# Largest distance in cells from the centre of a footprint to its border.
_PAD = 12
# A place is a whole cell: limits are half a cell wider than the specification.
HALF_CELL_M = 0.2
# Largest speed of a stationary vehicle; largest angle of a vehicle aligned with our road.
STANDS_MPS = 0.3
ALONG_DEG = 25.0
# Margin on each side.
EASY_M = 0.35
# Farther vehicles cover no cell of the map.
NEAR_MAP_M = 50.0


class Vehicle(NamedTuple):
    """True state of a vehicle, in the ego frame.

    Attributes:
        instance: instance token.
        body: sedan, van, ... in the simulator's terms.
        paint: name of its true colour.
        xy_m: (2,) centre.
        yaw_rad: heading.
        length_m: along its heading.
        width_m: across.
        speed_mps: over ground.
        parked: whether it is parked, and not part of the traffic.
        visible: whether its visibility is above the lowest level.
        on_map: whether its centre is on the map.
        cells: number of its cells in the exact map.
    """

    instance: str
    body: str
    paint: str
    xy_m: FloatArray
    yaw_rad: float
    length_m: float
    width_m: float
    speed_mps: float
    parked: bool
    visible: bool
    on_map: bool
    cells: int

    @property
    def stationary(self) -> bool:
        """Return whether it is stationary."""
        return self.speed_mps < STANDS_MPS

    @property
    def distance_m(self) -> float:
        """Return the distance between the centres of the ego and the vehicle."""
        return float(np.hypot(self.xy_m[0] - EGO.centre_m, self.xy_m[1]))

    def extent_m(self, yaw_rad: float) -> float:
        """Return its extent along a direction."""
        turn = self.yaw_rad - yaw_rad
        return float(self.length_m * abs(np.cos(turn)) + self.width_m * abs(np.sin(turn)))


@dataclass(frozen=True)
class TrueFrame:
    """A key frame.

    Attributes:
        token: token of the sample.
        bev: the exact map.
        owner: (X, Y) index in `vehicles` of the vehicle in a cell, -1 for none.
        boxes: all annotated boxes, ego frame, with true velocities.
        world_from_ego: (4, 4) pose.
        vehicles: all true vehicles, in the order of `boxes`, including those beyond the map.
    """

    token: str
    bev: BEVMap
    owner: IntArray
    boxes: Boxes
    world_from_ego: FloatArray
    vehicles: tuple[Vehicle, ...]

    @cached_property
    def centres(self) -> FloatArray:
        """Return the centres (X, Y, 2) of the cells."""
        return self.bev.grid.centres()

    @cached_property
    def ground(self) -> BoolArray:
        """Return the known road (X, Y)."""
        return np.asarray(self.bev.on[ROAD])

    @cached_property
    def occupied(self) -> BoolArray:
        """Return the cells (X, Y) of vehicles, by the map or by a box."""
        taken = self.bev.on[VEHICLE].copy()
        for one in (one for one in self.vehicles if np.abs(one.xy_m).max() < NEAR_MAP_M):
            along, across = self.local(one.xy_m, one.yaw_rad)
            taken |= (np.abs(along) <= one.length_m / 2) & (np.abs(across) <= one.width_m / 2)
        return np.asarray(taken)

    @cached_property
    def reachable(self) -> BoolArray:
        """Return the cells (X, Y) to which a disc of the ego's width can be moved; none if it is blocked."""
        return self._rolls(EGO.width_m / 2)

    @cached_property
    def comfortably_reachable(self) -> BoolArray:
        """Return the same cells (X, Y) with a margin."""
        return self._rolls(EGO.width_m / 2 + EASY_M)

    def _rolls(self, radius_m: float) -> BoolArray:
        clear_m = ndimage.distance_transform_edt(np.pad(self.ground & ~self.occupied, 1)) * self.bev.grid.cell_m
        labels, _ = ndimage.label(clear_m[1:-1, 1:-1] >= radius_m, np.ones((3, 3)))
        away = np.hypot(*np.moveaxis(self.centres - [EGO.centre_m, 0.0], -1, 0))
        start = labels.ravel()[np.argmin(np.where(labels > 0, away, np.inf))]
        near = (labels == start) & (away < 2.0)
        return np.asarray((labels == start) & (start > 0) & near.any())

    @cached_property
    def path(self) -> Lane | None:
        """Return our lane ahead, None without a kerb."""
        return own_path(self.bev.grid, self.ground)

    def our_yaw(self, x_m: float) -> float:
        """Return the direction of our lane at a place ahead, straight on without a kerb."""
        return self.path.yaw_rad(x_m) if self.path else 0.0

    def sideways_m(self, v: Vehicle) -> float:
        """Return the offset of a vehicle's centre to the left of our lane, straight on without a kerb."""
        return self._sideways_m[v.instance]

    @cached_property
    def _sideways_m(self) -> dict[str, float]:
        lane = self.path.y if self.path else np.zeros_like
        return {v.instance: float(v.xy_m[1] - lane(v.xy_m[0])) for v in self.vehicles}

    def has_lane_to(self, x_m: float) -> bool:
        """Return whether our lane is known up to a place ahead."""
        return self.path is not None and x_m <= self.path.far_m

    def turn_deg(self, v: Vehicle) -> float:
        """Return the heading of a vehicle relative to our direction there, -180..180."""
        return float(np.degrees(wrap_angle(v.yaw_rad - self.our_yaw(v.xy_m[0]))))

    def our_axis(self, v: Vehicle) -> float:
        """Return the direction of its long axis that is closer to our direction."""
        return v.yaw_rad if abs(self.turn_deg(v)) < 90 else v.yaw_rad + np.pi

    def is_along(self, v: Vehicle) -> bool:
        """Return whether it is aligned with our road, in either direction."""
        turn = abs(self.turn_deg(v))
        return min(turn, 180 - turn) <= ALONG_DEG

    def is_in_street(self, v: Vehicle) -> bool:
        """Return whether it is aligned with a street, and not in a car park."""
        return is_street(self.bev.grid, self.ground, v.xy_m, v.yaw_rad)

    def local(self, at_m: FloatArray, yaw_rad: float) -> tuple[FloatArray, FloatArray]:
        """Return the offsets (X, Y) of each cell along and to the left of a pose."""
        x, y = np.moveaxis(self.centres - at_m, -1, 0)
        cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
        return x * cos + y * sin, y * cos - x * sin

    def stands_free(self, cells: IntArray, yaw_rad: float, margin_m: float) -> BoolArray:
        """Return whether (K,) the ego fits on cells (K, 2) at a heading: on road, and clear of vehicles."""
        width = self.bev.grid.shape[1] + 2 * _PAD
        at = (cells + _PAD) @ [width, 1]
        free = np.ones(len(cells), np.bool_)
        for layer, grown_m in zip(self._padded, (0.0, margin_m), strict=True):
            below = _footprint_cells(self.bev.grid.cell_m, yaw_rad, grown_m) @ [width, 1]
            free &= layer[at[:, None] + below].all(axis=1)
        return free

    @cached_property
    def _padded(self) -> tuple[BoolArray, BoolArray]:
        """Return road and vehicle-free cells, flat, padded with neither."""
        return np.pad(self.ground, _PAD).ravel(), np.pad(~self.occupied, _PAD).ravel()


@lru_cache(maxsize=1024)
def _footprint_cells(cell_m: float, yaw_rad: float, margin_m: float) -> IntArray:
    """Return the offsets (N, 2) of the cells with centres in the ego's footprint, grown by a margin."""
    offsets = np.stack(np.meshgrid(*[np.arange(-_PAD, _PAD + 1)] * 2, indexing="ij"), axis=-1).reshape(-1, 2)
    x, y = offsets.T * cell_m
    cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
    along, across = np.abs(x * cos + y * sin), np.abs(y * cos - x * sin)
    return np.asarray(offsets[(along <= EGO.length_m / 2 + margin_m) & (across <= EGO.width_m / 2 + margin_m)])


# Reading ----------------------------------------------------------------------------------------------------------


class Town:
    """A simulated dataset with its data beyond the nuScenes schema."""

    def __init__(self, root: Path) -> None:
        """Open the dataset.

        Raises:
            DataError: if it is not a dataset, or not simulated.
        """
        self.dataset = Dataset(root)
        self._street_maps: dict[str, VectorMap | None] = {}
        paths = {name: self.dataset.tables.path(name) for name in ("paint", "sample_annotation", "attribute")}
        if not paths["paint"].is_file():
            raise DataError(f"{paths['paint']}: missing; cases are made of simulated datasets")
        rows: dict[str, list[dict[str, Any]]] = {name: read_json(path) for name, path in paths.items()}
        try:
            self._paints = {row["instance_token"]: (row["body"], row["name"]) for row in rows["paint"]}
            parked = {row["token"] for row in rows["attribute"] if row["name"] == "vehicle.parked"}
            self._states = {
                row["token"]: (np.array(row["velocity"], np.float64), bool(parked & set(row["attribute_tokens"])))
                for row in rows["sample_annotation"]
            }
        except (KeyError, TypeError, ValueError) as error:
            raise DataError(f"{paths['paint'].parent}: expected body, name and velocity, lacks {error}") from error

    def samples(self) -> list[Sample]:
        """Return all key frames."""
        return [sample for scene in self.dataset.scenes for sample in self.dataset.samples(scene)]

    def street_map(self, token: str) -> VectorMap | None:
        """Return the vector map of a key frame's town, as the command line gives it to the grounder; None without."""
        scene = self.dataset.scene(self.dataset.sample(token).scene_token)
        name = self.dataset.location(scene)
        if name not in self._street_maps:
            self._street_maps[name] = vector_map(self.dataset, scene)
        return self._street_maps[name]

    def moment(self, token: str) -> TrueFrame:
        """Return a key frame by its token."""
        sample = self.dataset.sample(token)
        bev = load_map(self.dataset.root, "exact", token)
        with zip_arrays(bev_path(self.dataset.root, "exact", token).read_bytes()) as data:
            instance = data["instance"]
        pose = self.dataset.world_from_ego(sample)
        world = self.dataset.boxes_world(sample)
        speeds = np.array([self._states[name][0] for name in world.token]).reshape(-1, 2)
        boxes = replace(world, velocity_mps=speeds).transformed(inverse(pose))
        owner = np.full(bev.grid.shape, -1, np.int64)
        names: Sequence[str] = bev.meta.get("instances", ())
        levels = visibility_levels(self.dataset, sample)
        vehicles: list[Vehicle] = []
        for i in (i for i in range(len(boxes)) if is_vehicle(boxes.category[i])):
            name = boxes.instance[i]
            if name in names:
                owner[instance == names.index(name)] = len(vehicles)
            body, paint = self._paints[name]
            xy_m, speed_mps = boxes.centre_m[i, :2].copy(), float(np.hypot(*boxes.velocity_mps[i]))
            on_map = bool(bev.grid.contains(bev.grid.cell_of(xy_m)))
            width_m, length_m, _ = boxes.size_wlh_m[i].tolist()
            vehicles.append(
                Vehicle(
                    *(name, body, paint, xy_m, float(boxes.yaw_rad[i]), length_m, width_m, speed_mps),
                    *(self._states[boxes.token[i]][1], levels.get(name, HIDDEN) != HIDDEN, on_map),
                    int(np.count_nonzero(owner == len(vehicles))),
                )
            )
        return TrueFrame(token, bev, owner, boxes, pose, tuple(vehicles))
