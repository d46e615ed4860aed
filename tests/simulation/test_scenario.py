from __future__ import annotations

import numpy as np
import pytest
from made_traffic import straight_traffic

from appocc.errors import DataError
from appocc.nuscenes.records import Scene
from appocc.nuscenes.simulated import weather_of
from appocc.simulation.scenario import WEATHER_SHARES, Scenario, describe_scenario, draw_scenario

WEATHERS = tuple(WEATHER_SHARES)


def test_the_ego_is_present_throughout_and_drives_most_of_the_time() -> None:
    log = straight_traffic()
    for number in range(40):
        scenario = draw_scenario(number, "town", log, 5.0, WEATHERS, 7)
        assert log.actors[scenario.ego].name in ("a", "b")
        assert scenario.start_s + 5.0 <= log.duration_s
        if scenario.ego == 1:  # stationary from 10 s on: at most a second of five
            assert scenario.start_s <= 6.01
        assert scenario.weather in WEATHERS


def test_scenes_differ_and_are_reproducible() -> None:
    log = straight_traffic()
    first = [draw_scenario(number, "town", log, 5.0, WEATHERS, 7) for number in range(20)]
    assert first == [draw_scenario(number, "town", log, 5.0, WEATHERS, 7) for number in range(20)]
    assert len({(scenario.ego, scenario.start_s) for scenario in first}) > 12


def test_weathers_follow_their_weights() -> None:
    log = straight_traffic()
    drawn = [draw_scenario(number, "town", log, 5.0, ("clear", "night"), 0).weather for number in range(300)]
    share = WEATHER_SHARES["clear"] / (WEATHER_SHARES["clear"] + WEATHER_SHARES["night"])
    assert np.mean([name == "clear" for name in drawn]) == pytest.approx(share, abs=0.08)


def test_a_scene_that_is_longer_than_the_traffic_is_refused() -> None:
    with pytest.raises(DataError, match="no vehicle drives for 60 s"):
        draw_scenario(0, "town", straight_traffic(), 60.0, WEATHERS, 0)


def test_the_weather_is_told_by_the_description() -> None:
    for name in WEATHERS:
        scenario = Scenario(name="scene-0000", number=0, town="random-17", ego=1, start_s=0.0, weather=name, seed=0)
        description = describe_scenario(scenario, straight_traffic().actors[1])
        assert weather_of(Scene("t", scenario.name, description, "l", "a", "b")).replace(" ", "_") == name
