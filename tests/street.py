"""A synthetic street for tests: a road of 16 m width along the ego's x axis, with vehicles at given positions."""

from __future__ import annotations

import numpy as np

from appocc.bevmap import ROAD, VEHICLE, BEVMap
from appocc.boxes import Boxes
from appocc.checks import FloatArray
from appocc.ego_vehicle import EgoVehicle
from appocc.geometry import apply, inverse, quaternion_from_yaw, transform
from appocc.grid import BEVGrid
from grounding.dialogue.session import Session
from grounding.grounder import Grounder
from grounding.referent.scene import SceneModel, scene_from_boxes, scene_from_map

WHITE, SILVER, GREY, BLACK = (245, 245, 245), (190, 191, 192), (110, 110, 112), (18, 18, 20)
RED, BLUE, GREEN, YELLOW = (190, 25, 30), (30, 60, 170), (30, 130, 50), (235, 200, 40)
# The ego is at (100, 50) and heads along world +y.
WORLD_FROM_EGO = transform(quaternion_from_yaw(np.pi / 2), [100.0, 50.0, 0.0])
HALF_ROAD_M = 8.0
EGO = EgoVehicle()


def area(x0: float, x1: float, y0: float = -8.0, y1: float = 8.0) -> FloatArray:
    """Return the outline (4, 2) of a rectangle of the ego frame, in the world: a strip across our lane."""
    corners = np.array([[x0, y0, 0], [x1, y0, 0], [x1, y1, 0], [x0, y1, 0]], np.float64)
    return apply(WORLD_FROM_EGO, corners)[:, :2]


class Street:
    """Add vehicles with `car`; `scene` is the scene model of the map and the annotations."""

    def __init__(self, grid: BEVGrid | None = None) -> None:
        """An empty street."""
        self.grid = grid or BEVGrid.surround()
        x, y = self.grid.shape
        self.occupancy = np.zeros((3, x, y), np.float32)
        self.appearance = np.full((3, x, y), 90, np.uint8)
        self.known = np.ones((x, y), np.bool_)
        self.road_known = np.ones((x, y), np.bool_)
        self.occupancy[ROAD, :, np.abs(self.grid.centres()[0, :, 1]) < HALF_ROAD_M] = 1
        self.rows: list[tuple[str, str, FloatArray, float, FloatArray, FloatArray]] = []

    def car(
        self,
        name: str,
        x_m: float,
        y_m: float,
        rgb: tuple[int, int, int] | None = WHITE,
        yaw_rad: float = 0.0,
        speed_mps: float = 0.0,
        size_wlh_m: tuple[float, float, float] = (1.8, 4.4, 1.5),
        category: str = "vehicle.car",
    ) -> Street:
        """Add a vehicle; without `rgb` the colour of its cells is unknown."""
        offset = self.grid.centres() - [x_m, y_m]
        cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
        along, across = offset @ [cos, sin], offset @ [-sin, cos]
        cells = (np.abs(along) <= size_wlh_m[1] / 2) & (np.abs(across) <= size_wlh_m[0] / 2)
        self.occupancy[VEHICLE][cells] = 1
        self.known[cells] = rgb is not None
        self.appearance[:, cells] = np.array(rgb or (0, 0, 0), np.uint8)[:, None]
        velocity = speed_mps * np.array([cos, sin])
        place = np.array([x_m, y_m, size_wlh_m[2] / 2])
        self.rows.append((name, category, place, yaw_rad, np.array(size_wlh_m), velocity))
        return self

    def bev(self) -> BEVMap:
        """Return the map."""
        valid = np.ones(self.occupancy.shape, np.bool_)
        valid[ROAD] = self.road_known
        return BEVMap(self.grid, self.occupancy.copy(), valid, self.appearance.copy(), self.known.copy())

    def boxes(self) -> Boxes:
        """Return the annotations in the ego frame."""
        if not self.rows:
            return Boxes.empty()
        names, categories, places, yaws, sizes, velocities = zip(*self.rows, strict=True)
        rotations = np.stack([transform(quaternion_from_yaw(yaw), [0, 0, 0])[:3, :3] for yaw in yaws])
        count = np.full(len(names), 5)
        return Boxes(
            centre_m=np.stack(places),
            size_wlh_m=np.stack(sizes),
            rotation=rotations,
            category=categories,
            instance=names,
            token=names,
            velocity_mps=np.stack(velocities),
            lidar_points=count,
        )

    def boxes_world(self) -> Boxes:
        """Return the annotations in the world frame, as in a dataset."""
        return self.boxes().transformed(WORLD_FROM_EGO)

    def scene(self) -> SceneModel:
        """Return the scene of map and annotations."""
        return scene_from_boxes(self.bev(), self.boxes_world().transformed(inverse(WORLD_FROM_EGO)), WORLD_FROM_EGO)

    def scene_without_boxes(self) -> SceneModel:
        """Return the scene of the map alone."""
        return scene_from_map(self.bev(), WORLD_FROM_EGO)

    def grounder(self, boxes: bool = True) -> Grounder:
        """Return a grounder with the map and, if `boxes`, the annotations as its scene."""
        grounder = Grounder()
        grounder.set_scene(self.bev(), self.boxes() if boxes else None, WORLD_FROM_EGO)
        return grounder


def told(session: Session, text: str) -> str:
    """Return what an accepted turn of a conversation tells."""
    answer = session.say(text)
    assert answer.status == "ok", answer.text()
    return "; ".join(answer.reasons)
