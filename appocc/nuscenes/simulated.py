"""Descriptions of simulated scenes in the scene table: town, weather and ego vehicle."""

from __future__ import annotations

import re

from appocc.nuscenes.records import Scene

_DESCRIPTION = re.compile(r"[^,]+, ([\w ]+), simulated\b")


def simulated_description(town: str, weather: str, ego: str, body: str) -> str:
    """Return the description of a simulated scene: town, weather, name and body type of the ego vehicle."""
    return f"{town}, {weather.replace('_', ' ')}, simulated; ego {ego} ({body})"


def weather_of(scene: Scene) -> str:
    """Return the weather of a simulated scene, such as 'low sun', from its description; '' for recorded scenes."""
    found = _DESCRIPTION.match(scene.description)
    return found[1] if found else ""
