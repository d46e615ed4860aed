"""Made traffic at a crossing, dense on purpose: streams that cross, queues that start, parked rows, things that hide.

Boxes move, and a line of sight over the ground tells what is hidden from the ego; no picture is drawn. Drivers follow
each other by the intelligent driver model (Treiber, Hennecke, Helbing 2000) and obey a traffic light; some turn
right. The ego is one of them. Paints are the simulator's, as frequent as on real streets: many vehicles look alike.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from appocc.checks import BoolArray, FloatArray, IntArray
from appocc.geometry import quaternion_from_yaw, transform
from appocc.simulation.actors.paint import draw_paint
from appocc.simulation.traffic import Actor

# Kind: share of the traffic; width, length, height.
MIX = {
    "car": (0.70, (1.8, 4.5, 1.5)),
    "van": (0.14, (2.0, 5.6, 2.3)),
    "truck": (0.09, (2.5, 8.5, 3.4)),
    "bus": (0.07, (2.55, 11.5, 3.1)),
}
# Of an outline, less than this in sight is nuScenes' lowest level of visibility.
LEAST_SEEN = 0.4

_STEP_S, _WARM_S, _NEAR_M = 0.1, 40.0, 70.0
_LANE_M, _STOP_M, _FAR_M, _CORNER_M = 3.3, 14.0, 75.0, 5.0
# One street goes, nobody, the other one, nobody.
_PHASES_S = (9.0, 3.0, 9.0, 3.0)
_PARKED_SHARE, _KERB_M, HOUSE_M = 0.7, 8.9, 16.0
# The driver model's acceleration, comfortable braking, time headway and gap at rest.
_PUSH_MPS2, _BRAKE_MPS2, _HEADWAY_S, _STILL_M = 2.0, 3.0, 0.9, 1.8


@dataclass(frozen=True)
class Sight:
    """A moment: the N vehicles around the ego, world frame.

    Attributes:
        timestamp_us: when.
        world_from_ego: (4, 4) pose of the ego, below its centre.
        number: (N,) the same vehicle over time.
        xy_m: (N, 2) centres.
        yaw_rad: (N,) headings.
        size_m: (N, 3) width, length, height.
        rgb: (N, 3) paints, sRGB 0..255.
        seen: (N,) whether enough of it is in the ego's sight.
    """

    timestamp_us: int
    world_from_ego: FloatArray
    number: IntArray
    xy_m: FloatArray
    yaw_rad: FloatArray
    size_m: FloatArray
    rgb: FloatArray
    seen: BoolArray


class _Vehicle(NamedTuple):
    number: int
    size_m: FloatArray
    rgb: tuple[int, int, int]


class _Placed(NamedTuple):
    vehicle: _Vehicle
    x_m: float
    y_m: float
    yaw_rad: float


@dataclass
class _Driver:
    vehicle: _Vehicle
    turns: bool
    wish_mps: float
    speed_mps: float
    along_m: float = 0.0


@dataclass
class _Lane:
    """A lane to the crossing and past it; the first driver is the farthest."""

    heading_rad: float
    right_m: float
    street: int
    busy_hz: float
    drivers: list[_Driver]


def encounters(seed: int, seconds: float = 20.0, hz: float = 2.0) -> list[Sight]:
    """The moments of the scene of a seed."""
    crossing = _Crossing(seed)
    moments = [round((_WARM_S + k / hz) / _STEP_S) for k in range(round(seconds * hz) + 1)]
    driving = []
    for step in range(moments[-1] + 1):
        if step in moments:
            driving.append(crossing.driving())
        crossing.step()
    ego = _ego(driving)
    times_us = [round(k / hz * 1e6) for k in range(len(moments))]
    return [_sight(time_us, moving + crossing.parked, ego) for time_us, moving in zip(times_us, driving, strict=True)]


class _Crossing:
    """Two streets of two lanes each way, and who drives and parks there."""

    def __init__(self, seed: int) -> None:
        self._random = np.random.default_rng([seed, 5])
        self._paints = int(self._random.integers(2**31))
        self._time_s = float(self._random.uniform(0, sum(_PHASES_S)))
        self._made = 0
        ways = [(way, side) for way in range(4) for side in range(2)]
        self._lanes = [
            _Lane(way * np.pi / 2, _LANE_M * (0.5 + side), way % 2, self._random.uniform(0.4, 1.0), [])
            for way, side in ways
        ]
        self.parked = [placed for way in range(4) for placed in self._row(way * np.pi / 2)]

    def driving(self) -> list[_Placed]:
        """All who drive."""
        return [_place(lane, driver) for lane in self._lanes for driver in lane.drivers]

    def step(self) -> None:
        """Everyone drives on for a step, and who has room enters."""
        self._time_s += _STEP_S
        phase = int(np.searchsorted(np.cumsum(_PHASES_S), self._time_s % sum(_PHASES_S), side="right"))
        for lane in self._lanes:
            _drive(lane, green=phase == 2 * lane.street)
            last = lane.drivers[-1] if lane.drivers else None
            room_m = last.along_m - last.vehicle.size_m[1] / 2 if last else np.inf
            if room_m > 14.0 and self._random.random() < lane.busy_hz * _STEP_S:
                wish = float(self._random.uniform(9.0, 14.0))
                turns = lane.right_m > _LANE_M and self._random.random() < 0.4
                speed = min(wish, last.speed_mps) if last else wish
                lane.drivers.append(_Driver(self._vehicle(tuple(MIX)), turns, wish, speed))

    def _vehicle(self, kinds: tuple[str, ...]) -> _Vehicle:
        self._made += 1
        shares = np.array([MIX[kind][0] for kind in kinds])
        kind = kinds[int(self._random.choice(len(kinds), p=shares / shares.sum()))]
        size = np.array(MIX[kind][1]) * self._random.normal(1, 0.04, 3).clip(0.9, 1.1)
        width, length, height = size.tolist()
        paint = draw_paint(Actor(f"{kind}_{self._made}", kind, "", (length, width, height)), self._paints)
        return _Vehicle(self._made, size, paint.rgb)

    def _row(self, heading_rad: float) -> list[_Placed]:
        """Cars parked at the kerb on the way to the crossing."""
        row, along_m = [], -_FAR_M
        while along_m < -_STOP_M - 8.0:
            if self._random.random() >= _PARKED_SHARE:
                along_m += 6.0
                continue
            vehicle, crooked = self._vehicle(("car", "van")), float(self._random.normal(0, 0.02))
            length_m = float(vehicle.size_m[1])
            place = _turned(along_m + length_m / 2, -_KERB_M, heading_rad)
            row.append(_Placed(vehicle, *place, heading_rad + crooked))
            along_m += length_m + float(self._random.uniform(0.6, 1.4))
        return row


def _drive(lane: _Lane, green: bool) -> None:
    """The drivers of a lane go on for a step, each by the one in front and by the light."""
    end_m, speed_ahead = np.inf, 0.0
    for driver in lane.drivers:
        half_m, speed = driver.vehicle.size_m[1] / 2, driver.speed_mps
        gap, closing = end_m - driver.along_m - half_m, speed - speed_ahead
        stop = _FAR_M - _STOP_M - driver.along_m - half_m
        if not green and max(-0.5, speed**2 / (2 * _BRAKE_MPS2) - 1.0) < stop < gap:
            gap, closing = stop, speed
        wish = _STILL_M + max(0.0, speed * (_HEADWAY_S + closing / (2 * np.sqrt(_PUSH_MPS2 * _BRAKE_MPS2))))
        push = _PUSH_MPS2 * (1 - (speed / driver.wish_mps) ** 4 - (wish / max(gap, 0.1)) ** 2)
        driver.speed_mps = max(0.0, speed + _STEP_S * max(push, -8.0))
        driver.along_m += _STEP_S * driver.speed_mps
        end_m, speed_ahead = driver.along_m - half_m, driver.speed_mps
    lane.drivers = [driver for driver in lane.drivers if driver.along_m < 2 * _FAR_M]


def _place(lane: _Lane, driver: _Driver) -> _Placed:
    """Where a driver is: straight on, or around the corner into the outermost lane, where nobody else goes."""
    along_m, left_m, yaw_rad = driver.along_m - _FAR_M, -lane.right_m, lane.heading_rad
    begin_m = -1.5 * _LANE_M - _LANE_M - _CORNER_M
    if driver.turns and along_m > begin_m:
        angle = min((along_m - begin_m) / _CORNER_M, np.pi / 2)
        past_m = max(0.0, along_m - begin_m - _CORNER_M * np.pi / 2)
        along_m = begin_m + _CORNER_M * np.sin(angle)
        left_m -= _CORNER_M * (1 - np.cos(angle)) + past_m
        yaw_rad -= angle
    return _Placed(driver.vehicle, *_turned(along_m, left_m, lane.heading_rad), yaw_rad)


def _turned(x_m: float, y_m: float, angle_rad: float) -> tuple[float, float]:
    cos, sin = float(np.cos(angle_rad)), float(np.sin(angle_rad))
    return cos * x_m - sin * y_m, sin * x_m + cos * y_m


def _ego(driving: list[list[_Placed]]) -> int:
    """Number of the driver who is nearest to the crossing, in the mean over all moments."""
    away: dict[int, list[float]] = {}
    for moment in driving:
        for placed in moment:
            away.setdefault(placed.vehicle.number, []).append(float(np.hypot(placed.x_m, placed.y_m)))
    always = {number: float(np.mean(all_m)) for number, all_m in away.items() if len(all_m) == len(driving)}
    return min(always, key=lambda number: always[number])


def _sight(timestamp_us: int, placed: list[_Placed], ego: int) -> Sight:
    own = next(one for one in placed if one.vehicle.number == ego)
    away = [np.hypot(one.x_m - own.x_m, one.y_m - own.y_m) for one in placed]
    others = [one for one, m in zip(placed, away, strict=True) if one.vehicle.number != ego and m <= _NEAR_M]
    xy_m = np.array([[one.x_m, one.y_m] for one in others])
    yaw_rad = np.array([one.yaw_rad for one in others])
    size_m = np.array([one.vehicle.size_m for one in others])
    pose = transform(quaternion_from_yaw(own.yaw_rad), [own.x_m, own.y_m, 0.0])
    return Sight(
        timestamp_us,
        pose,
        np.array([one.vehicle.number for one in others]),
        xy_m,
        yaw_rad,
        size_m,
        np.array([one.vehicle.rgb for one in others], dtype=np.float64),
        _shares_in_sight(pose[:2, 3], xy_m, yaw_rad, size_m) >= LEAST_SEEN,
    )


def _shares_in_sight(eye_m: FloatArray, xy_m: FloatArray, yaw_rad: FloatArray, size_m: FloatArray) -> FloatArray:
    """(N,) shares of the outlines that are turned to an eye (2,) which no house or vehicle of like height hides."""
    n = len(xy_m)
    points, outward = _outlines(xy_m, yaw_rad, size_m)
    turned = np.einsum("nki,nki->nk", outward, eye_m - points) > 0
    corner = np.array([[-1, -1], [-1, 1], [1, -1], [1, 1]]) * (HOUSE_M + 100.0)
    boxes = np.concatenate(
        [
            np.column_stack([xy_m, yaw_rad, size_m]),
            np.column_stack([corner, np.zeros(4), np.full((4, 2), 200.0), np.full(4, 99.0)]),
        ]
    )
    hidden = np.zeros((n, points.shape[1]), np.bool_)
    for k, (x, y, yaw, width, length, height) in enumerate(boxes.tolist()):
        hides = _crosses(eye_m, points, np.array([x, y]), yaw, np.array([length, width]) / 2)
        hides &= (height >= 0.8 * size_m[:, 2])[:, None]
        if k < n:
            hides[k] = False
        hidden |= hides
    return np.asarray((turned & ~hidden).sum(axis=1) / np.maximum(turned.sum(axis=1), 1))


def _outlines(xy_m: FloatArray, yaw_rad: FloatArray, size_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Points (N, 16, 2) on the sides of boxes, and the directions (N, 16, 2) that the sides face."""
    spots = np.array([-0.75, -0.25, 0.25, 0.75])
    sides = [(np.full(4, 1.0), spots, (1, 0)), (np.full(4, -1.0), spots, (-1, 0))]
    sides += [(spots, np.full(4, 1.0), (0, 1)), (spots, np.full(4, -1.0), (0, -1))]
    local = np.concatenate([np.stack([along, across], axis=1) for along, across, _ in sides])
    facing = np.concatenate([np.tile(face, (4, 1)) for *_, face in sides]).astype(np.float64)
    cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
    turn = np.stack([np.stack([cos, -sin], axis=1), np.stack([sin, cos], axis=1)], axis=1)
    scaled = local[None] * size_m[:, None, [1, 0]] / 2
    return xy_m[:, None] + np.einsum("nij,nkj->nki", turn, scaled), np.einsum("nij,kj->nki", turn, facing)


def _crosses(
    eye_m: FloatArray, points_m: FloatArray, centre_m: FloatArray, yaw_rad: float, half_m: FloatArray
) -> BoolArray:
    """Whether the ways from an eye to points (..., 2) lead through a box."""
    cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
    to_box = np.array([[cos, sin], [-sin, cos]])
    start = to_box @ (eye_m - centre_m)
    way = (points_m - eye_m) @ to_box.T
    way = np.where(np.abs(way) < 1e-9, 1e-9, way)
    near, far = (-half_m - start) / way, (half_m - start) / way
    enter = np.minimum(near, far).max(axis=-1)
    leave = np.maximum(near, far).min(axis=-1)
    return np.asarray((enter < leave) & (leave > 0) & (enter < 1))
