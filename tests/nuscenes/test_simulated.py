from __future__ import annotations

import pytest

from appocc.nuscenes.records import Scene
from appocc.nuscenes.simulated import weather_of


@pytest.mark.parametrize(
    ("description", "weather"),
    [("aldermoor, low sun, simulated; ego car_70 (minivan)", "low sun"), ("Parking lot, rain, bus", ""), ("", "")],
)
def test_the_weather_of_simulated_scenes(description: str, weather: str) -> None:
    assert weather_of(Scene("t", "s", description, "l", "a", "b")) == weather
