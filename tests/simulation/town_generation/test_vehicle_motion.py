"""Vehicle motion from SUMO's bumpers, curve speeds and overlaps."""

from __future__ import annotations

import numpy as np

from appocc.checks import FloatArray
from appocc.simulation.network import Edge, Lane, RoadNetwork
from appocc.simulation.town_generation.curve_speed import curve_speeds
from appocc.simulation.town_generation.motion import AXLE_SHARE, vehicle_motion
from appocc.simulation.town_generation.overlaps import overlapping, without_overlaps
from appocc.simulation.traffic import Actor


def _corner(steps: int = 400, speed: float = 4.0) -> tuple[FloatArray, FloatArray]:
    """A bumper that goes east and turns north on the spot, like SUMO's where lanes meet."""
    along = np.arange(steps) * 0.1 * speed
    bend = along[steps // 2]
    front = np.stack([np.minimum(along, bend), np.maximum(along - bend, 0)], axis=1)
    return front[:, None], np.where(along < bend, 0.0, np.pi / 2)[:, None]


def test_a_car_does_not_turn_on_the_spot() -> None:
    front, yaw = _corner()
    centre, turned, part = vehicle_motion(front, yaw, np.array([4.5]))
    rate = np.rad2deg(np.abs(np.diff(np.unwrap(turned[:, 0])))) / 0.1
    assert rate.max() < 75
    assert np.cos(turned[-1, 0] - np.pi / 2) > 0.999
    assert (part == 0).all()
    ahead = np.stack([np.cos(turned[:, 0]), np.sin(turned[:, 0])], axis=1)
    axle = np.diff(centre[:, 0] - ahead * (AXLE_SHARE - 0.5) * 4.5, axis=0) / 0.1
    middle = (ahead[1:] + ahead[:-1]) / 2
    assert np.abs(axle[:, 0] * middle[:, 1] - axle[:, 1] * middle[:, 0]).max() < 0.15
    # The nose stays where SUMO has it, but for the rounded corner.
    assert np.hypot(*(centre[:, 0] + ahead * 2.25 - front[:, 0]).T).max() < 1.2


def test_a_stationary_car_does_not_move() -> None:
    front = np.tile([[[3.0, 4.0]]], (50, 1, 1))
    centre, yaw, _ = vehicle_motion(front, np.full((50, 1), 0.5), np.array([4.0]))
    np.testing.assert_allclose(yaw, 0.5)
    np.testing.assert_allclose(centre[:, 0], np.tile([3 - 2 * np.cos(0.5), 4 - 2 * np.sin(0.5)], (50, 1)))


def test_a_gap_or_a_jump_splits_a_presence() -> None:
    front, yaw = _corner()
    front[50:60], yaw[50:60] = np.nan, np.nan
    front[100:] += 30.0
    centre, _, part = vehicle_motion(front, yaw, np.array([4.5]))
    assert [part[k, 0] for k in (0, 49, 50, 60, 99, 100, 399)] == [0, 0, -1, 1, 1, 2, 2]
    assert np.isnan(centre[50:60]).all()
    assert np.isfinite(centre[60:]).all()


def test_curves_are_slow_with_braking_distance() -> None:
    angle = np.linspace(-np.pi / 2, 0, 20)
    line = np.concatenate([[[-60, -12], [-30, -12]], np.stack([12 * np.cos(angle), 12 * np.sin(angle)], axis=1)])
    lanes = (
        Lane(name="a_0", edge="a", index=0, kind="driving", width_m=3.2, speed_mps=13.9, centre_m=line),
        Lane(name="a_1", edge="a", index=1, kind="driving", width_m=3.2, speed_mps=13.9, centre_m=line[:2] * 1.0),
        Lane(name="a_2", edge="a", index=2, kind="parking", width_m=2.3, speed_mps=13.9, centre_m=line * 1.0),
    )
    zero = np.zeros(2)
    speeds = curve_speeds(
        RoadNetwork(
            edges=(Edge("a", "i", "j", 1, lanes),),
            inner_lanes=(),
            junctions=(),
            connections=(),
            low_m=zero,
            high_m=zero,
            offset_m=zero,
        )
    )
    assert list(speeds) == ["a_0"]
    assert 4.5 < speeds["a_0"].min() < 6.5
    assert speeds["a_0"][0] > 10
    assert (np.diff(speeds["a_0"][:25]) < 0.1).all()


def test_parked_cars_go_before_those_that_move() -> None:
    actors = [Actor(f"a{k}", "car", "sedan", (4.6, 1.8, 1.5)) for k in range(5)]
    xy = np.full((3, 5, 2), np.nan)
    xy[:, 0] = [[0, 0], [5, 0], [10, 0]]
    xy[:, 1] = [10.0, 1.0]  # parked: car 0 runs into it
    xy[:, 2] = [[40, 0], [41, 0], [42, 0]]
    xy[1:, 3] = [[41.5, 0.5], [42, 9]]  # there for less time than car 2
    xy[:, 4] = [10.0, 2.9]  # next to car 1, 0.1 m apart
    yaw, parked = np.zeros((3, 5)), np.array([False, True, False, False, True])
    assert overlapping(actors, xy, yaw, parked) == {(0, 1), (2, 3)}
    assert without_overlaps(actors, xy, yaw, parked).tolist() == [True, False, True, False, True]
