"""Road users that are exchanged and added around the ego of a scene."""

from __future__ import annotations

from collections import Counter
from typing import NamedTuple

import numpy as np
import pytest
from made_traffic import straight_traffic

from appocc.simulation.builtin import load_builtin
from appocc.simulation.ground import build_ground
from appocc.simulation.mesh import join_meshes
from appocc.simulation.scenario import Scenario, draw_scenario
from appocc.simulation.surface import ROAD_SURFACES, surface_table
from appocc.simulation.town import Town
from appocc.simulation.town_generation.overlaps import overlapping
from appocc.simulation.traffic import TrafficLog
from appocc.simulation.variation.excerpt import Excerpt
from appocc.simulation.variation.exchanged_bodies import labels_at
from appocc.simulation.variation.traffic import vary_traffic

SECONDS, SCENES = 8.0, 6


class Scene(NamedTuple):
    """A scene's traffic before and after its variation."""

    scenario: Scenario
    before: TrafficLog
    after: TrafficLog

    def shown(self, log: TrafficLog) -> Excerpt:
        return Excerpt.of(log, self.scenario.start_s, SECONDS, self.scenario.ego)

    @property
    def exchanged(self) -> list[int]:
        pairs = zip(self.before.actors, self.after.actors, strict=False)
        return [row for row, (old, new) in enumerate(pairs) if old != new]

    @property
    def added(self) -> range:
        return range(len(self.before.actors), len(self.after.actors))


@pytest.fixture(scope="module")
def town() -> Town:
    plan, _ = load_builtin("fernport")
    ground, lines = build_ground(plan)
    return Town(plan, ground, join_meshes([]), np.zeros((0, 3)), lines)


@pytest.fixture(scope="module")
def scenes(town: Town) -> list[Scene]:
    _, log = load_builtin("fernport")
    drawn = [draw_scenario(number, "fernport", log, SECONDS, ("clear",), 5) for number in range(SCENES)]
    return [Scene(scenario, log, vary_traffic(log, town, scenario, SECONDS)) for scenario in drawn]


def test_the_same_scene_gives_the_same_traffic(town: Town, scenes: list[Scene]) -> None:
    again = vary_traffic(scenes[0].before, town, scenes[0].scenario, SECONDS)
    assert again.actors == scenes[0].after.actors
    np.testing.assert_array_equal(again.xy_m, scenes[0].after.xy_m)


def test_the_ego_and_all_others_stay(scenes: list[Scene]) -> None:
    for scene in scenes:
        count = len(scene.before.actors)
        stays = np.setdiff1d(np.arange(count), scene.exchanged)
        assert scene.scenario.ego in stays
        np.testing.assert_array_equal(scene.after.xy_m[:, stays], scene.before.xy_m[:, stays])
        np.testing.assert_array_equal(scene.after.yaw_rad[:, stays], scene.before.yaw_rad[:, stays])
        np.testing.assert_array_equal(scene.after.lights[:, :count], scene.before.lights)


def test_changes_are_within_the_scene(scenes: list[Scene]) -> None:
    for scene in scenes:
        steps = np.arange(len(scene.after.xy_m)) * scene.after.step_s
        outside = (steps < scene.scenario.start_s - 0.3) | (steps > scene.scenario.start_s + SECONDS + 0.5)
        count = len(scene.before.actors)
        np.testing.assert_array_equal(scene.after.xy_m[outside, :count], scene.before.xy_m[outside])
        assert np.isnan(scene.after.xy_m[outside, count:]).all()
        assert np.isfinite(scene.shown(scene.after).xy_m[:, count:]).all()


def test_rare_kinds_become_more_frequent(scenes: list[Scene]) -> None:
    before, after = Counter[str](), Counter[str]()
    for scene in scenes:
        for counts, log in ((before, scene.before), (after, scene.after)):
            counts.update(log.actors[row].body for row in np.flatnonzero(scene.shown(log).near_ego(40.0)))
    for bodies in (("bus", "box_truck"), ("motorcycle", "bicycle"), ("adult", "child")):
        assert sum(after[body] for body in bodies) > 1.3 * sum(before[body] for body in bodies)
    assert after["sedan"] > 0.6 * before["sedan"], "most cars stay"


def test_nobody_touches_anybody(scenes: list[Scene]) -> None:
    for scene in scenes:
        old, new = (scene.shown(log) for log in (scene.before, scene.after))
        pairs = [overlapping(list(s.actors), s.xy_m, s.yaw_rad, s.parked) for s in (old, new)]
        assert pairs[1] <= pairs[0]


def test_people_cross_from_kerb_to_kerb_and_cyclists_ride_on_the_road(town: Town, scenes: list[Scene]) -> None:
    road = surface_table(ROAD_SURFACES)
    crossed = 0
    for scene in scenes:
        for row in scene.added:
            way = scene.shown(scene.after).xy_m[:, row]
            on_road = road[labels_at(town.ground, way)]
            speed = np.hypot(*np.diff(way, axis=0).T) / scene.after.step_s
            if scene.after.actors[row].kind == "pedestrian":
                assert speed.max() < 1.9
                crossed += bool(on_road.any())
            else:
                assert on_road.all()
                assert speed.max() < 6.6
    assert crossed > SCENES


def test_exchanged_bodies_stay_on_the_road_and_keep_their_way(scenes: list[Scene]) -> None:
    exchanged = 0
    for scene in scenes:
        old, new = (scene.shown(log) for log in (scene.before, scene.after))
        for row in scene.exchanged:
            exchanged += 1
            fronts = [
                s.xy_m[:, row]
                + s.size_m[row, 0] / 2 * np.stack([np.cos(s.yaw_rad[:, row]), np.sin(s.yaw_rad[:, row])], axis=1)
                for s in (old, new)
            ]
            away = np.hypot(*(fronts[1] - fronts[0]).T)
            assert np.nanmax(away) < 1.0
    assert exchanged > SCENES / 2


def test_a_way_in_front_of_a_vehicle_is_not_clear() -> None:
    """Car a drives at 5 m/s along y = 0, all others are far behind it."""
    scene = Excerpt.of(straight_traffic(), 14.0, 2.0, ego=1)

    def clear(ahead_m: float, left_m: float) -> bool:
        return scene.keeps_clear((scene.xy_m[:, 0] + [ahead_m, left_m])[:, None], 0.3)

    assert not clear(0.0, 0.0)
    assert not clear(2.25 + 5.0, 0.0), "it is there in a second"
    assert not clear(2.25 + 5.0, 1.5)
    assert clear(2.25 + 5.0 + 1.5, 0.0)
    assert clear(0.0, 2.5)
    assert clear(-2.25 - 1.5, 0.0)
