"""Ways of the ego as a car drives: with its turning circle and its footprint, forwards and backwards.

From one pose, all poses are reached by a search over short arcs (hybrid A* without a goal: Dolgov et al., "Practical
search techniques in path planning for autonomous driving", 2008), once for all commands. A goal is connected to the
poses around it by Reeds-Shepp curves.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import ndimage

from appocc.checks import BoolArray, FloatArray, IntArray
from appocc.ego_vehicle import EgoVehicle
from appocc.grid import BEVGrid
from grounding.road.car_search import HEADINGS, OUTSIDE, STATE_CELLS, CarModel, connect, search_poses, shorten
from grounding.road.pose import Pose2D

# Greatest distance backwards unless the command asks for more.
MOST_BACK_M = 10.0
# A goal this near straight ahead, to such a share of a cell and turned by less than the angle, needs no steering.
_STRAIGHT_M, _ROUNDED, _STAYS_RAD = 3.0, 0.75, 0.1


@dataclass(frozen=True, eq=False)
class CarRoute:
    """A way that a car drives to a goal.

    Attributes:
        points_m: (K, 2) centre of the footprint, ego frame, at most 0.5 m apart.
        heading_rad: (K,) heading there.
        backwards: (K,) whether the car arrives there backwards.
    """

    points_m: FloatArray
    heading_rad: FloatArray
    backwards: BoolArray

    @cached_property
    def _steps_m(self) -> FloatArray:
        return np.asarray(np.hypot(*np.diff(self.points_m, axis=0).T))

    @property
    def length_m(self) -> float:
        """Length of the way, forwards and backwards."""
        return float(self._steps_m.sum())

    @property
    def backwards_m(self) -> float:
        """Metres backwards."""
        return float(self._steps_m[self.backwards[1:]].sum())

    @property
    def turned_rad(self) -> float:
        """Largest change of heading on the way, beyond that at the goal: a turn in the road."""
        return float(np.abs(np.unwrap(self.heading_rad) - self.heading_rad[0]).max())


@dataclass(frozen=True, eq=False)
class CarPaths:
    """The poses that the ego reaches from one pose, and the ways there.

    Attributes:
        grid: cells.
        ego: size of the ego vehicle.
        start: pose of the centre of its footprint.
        clearance_m: (X, Y) distance of each cell to the nearest one that is not free.
        extra_cost: (X, Y) cost of a metre in a cell, beyond one.
        most_back_m: greatest distance backwards.
    """

    grid: BEVGrid
    ego: EgoVehicle
    start: Pose2D
    clearance_m: FloatArray
    extra_cost: FloatArray
    most_back_m: float = MOST_BACK_M

    @cached_property
    def _model(self) -> CarModel:
        half = self.ego.width_m / 2
        reach = self.ego.length_m / 2 - half
        count = int(np.ceil(2 * reach / half)) + 1
        low = self.grid.centre_of(np.zeros(2, np.int64))
        return CarModel(
            clearance=np.ascontiguousarray(self.clearance_m, dtype=np.float32),
            extra=np.ascontiguousarray(self.extra_cost, dtype=np.float32),
            low_m=np.asarray(low, dtype=np.float64),
            cell_m=float(self.grid.cell_m),
            discs_m=self.ego.centre_m + np.linspace(-reach, reach, count),
            disc_m=half,
            radius_m=self.ego.turning_radius_m,
            most_back_m=self.most_back_m,
            body=np.array([*self.start.xy_m, *self.start.ahead, self.ego.length_m / 2, half]),
        )

    @cached_property
    def _reached(self) -> FloatArray:
        """(I, J, HEADINGS, 8) the best pose of the rear axle in each state, see `search_poses`."""
        return search_poses(
            self._model, self._rear_axle(self.start.xy_m[None], np.array([self.start.heading_rad]))[0]
        )

    def _rear_axle(self, xy_m: FloatArray, heading_rad: FloatArray) -> FloatArray:
        """Return poses (N, 3) of the rear axle for poses of the centre."""
        ahead = np.stack([np.cos(heading_rad), np.sin(heading_rad)], axis=-1)
        return np.concatenate([xy_m - self.ego.centre_m * ahead, heading_rad[:, None]], axis=-1)

    @cached_property
    def _cost_near(self) -> FloatArray:
        """(I, J, HEADINGS) least cost of a pose in a state or one next to it."""
        cost = self._reached[..., 0]
        return np.asarray(ndimage.minimum_filter(cost, 3, mode=("nearest", "nearest", "wrap")))

    @cached_property
    def _backwards_near(self) -> FloatArray:
        """(I, J, HEADINGS) least metres backwards to a pose in a state or one next to it."""
        back = np.where(np.isfinite(self._reached[..., 0]), self._reached[..., 4], np.inf)
        return np.asarray(ndimage.minimum_filter(back, 3, mode=("nearest", "nearest", "wrap")))

    def cost_to(self, cells: IntArray, heading_rad: FloatArray) -> FloatArray:
        """Return the costs (N,) of ways to poses near cells (N, 2) at headings (N,), infinity where there is none.

        A metre forwards costs one or more; backwards, changes of gear and narrow passages cost extra.
        """
        return self._near(self._cost_near, cells, heading_rad)

    def backwards_to(self, cells: IntArray, heading_rad: FloatArray) -> FloatArray:
        """Return the metres backwards (N,) on cheap ways to poses near cells (N, 2), infinity where there is none."""
        return self._near(self._backwards_near, cells, heading_rad)

    def _near(self, values: FloatArray, cells: IntArray, heading_rad: FloatArray) -> FloatArray:
        """Return the values (N,) of an array (I, J, HEADINGS) at poses; infinity outside."""
        rear = self._rear_axle(self.grid.centre_of(cells), heading_rad)
        span = self.grid.cell_m * STATE_CELLS
        i, j = np.floor((rear[:, :2] - self._model.low_m) / span + 0.5).astype(np.int64).T + OUTSIDE
        k = np.floor(rear[:, 2] / (2 * np.pi) * HEADINGS + 0.5).astype(np.int64) % HEADINGS
        x, y, _ = values.shape
        inside = (i >= 0) & (j >= 0) & (i < x) & (j < y)
        return np.where(inside, values[np.where(inside, i, 0), np.where(inside, j, 0), k], np.inf)

    def route_to(self, cell: tuple[int, int], heading_rad: float) -> CarRoute | None:
        """Return the way to a cell at a heading; None if a car does not get there."""
        centre = self.grid.centre_of(np.array(cell))
        turned = (heading_rad - self.start.heading_rad + np.pi) % (2 * np.pi) - np.pi
        (dx, dy), (cos, sin) = centre - self.start.xy_m, self.start.ahead
        ahead_m, aside_m = dx * cos + dy * sin, dy * cos - dx * sin
        straight = -self.grid.cell_m < ahead_m < _STRAIGHT_M and abs(aside_m) < self.grid.cell_m * _ROUNDED
        if straight and abs(turned) < _STAYS_RAD:
            # It stays where it is, or rolls straight on: the goal is the nearest cell.
            points = np.linspace(self.start.xy_m, centre, int(2 * abs(ahead_m)) + 2)
            return CarRoute(points, np.full(len(points), self.start.heading_rad), np.zeros(len(points), np.bool_))
        goal = self._rear_axle(self.grid.centre_of(np.array([cell])), np.array([heading_rad]))[0]
        states = connect(self._model, self._reached, goal)
        if not len(states):
            return None
        poses = shorten(self._model, states)
        ahead = np.stack([np.cos(poses[:, 2]), np.sin(poses[:, 2])], axis=-1)
        return CarRoute(poses[:, :2] + self.ego.centre_m * ahead, poses[:, 2], poses[:, 3] < 0)
