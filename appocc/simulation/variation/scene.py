"""What a scene varies, drawn once from its random seed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from appocc.camera import CameraRig
from appocc.rigs import SourceRig
from appocc.rigs.variation import vary_rig, vary_source_rig
from appocc.simulation.rendering.look import Look
from appocc.simulation.rendering.weather import Weather
from appocc.simulation.variation.light import vary_weather
from appocc.simulation.variation.materials import draw_look
from appocc.simulation.variation.slope import Slope, draw_slope

# Share of the scenes that keep the rig, the town's materials, and the weather as they are, each on its own.
_KEPT_RIGS, _KEPT_LOOKS, _KEPT_WEATHERS = 1 / 3, 0.2, 0.2
_RARE_PAINTS = 0.4


@dataclass(frozen=True, eq=False)
class SceneVariation:
    """How a scene is recorded; the defaults are those of a scene that is not varied.

    Attributes:
        rig: cameras.
        weather: light and atmosphere.
        rare_paints: share of the vehicles whose colour word is drawn uniformly instead of by real-world shares.
        look: materials of the town, None as built.
        slope: of the ground relative to gravity along x and y of the town.
        source: cameras with other lenses, whose pictures are rectified to the rig; None for pinholes.
    """

    rig: CameraRig
    weather: Weather
    rare_paints: float = 0.0
    look: Look | None = None
    slope: Slope = (0.0, 0.0)
    source: SourceRig | None = None


def draw_variation(
    rig: CameraRig, weather: Weather, seed: Sequence[int], source: SourceRig | None = None
) -> SceneVariation:
    """Draw the variation of a scene (domain randomisation: Acuna, Philion & Fidler 2021, arXiv 2111.07971).

    Args:
        rig: cameras of the dataset.
        weather: of the scene.
        seed: random seed of the scene and of this draw.
        source: cameras with other lenses that are rectified to the rig; None for pinholes.
    """
    random = np.random.default_rng(seed)
    keep_rig, keep_look, keep_weather = random.random(3) < [_KEPT_RIGS, _KEPT_LOOKS, _KEPT_WEATHERS]
    # Each part has its own stream, so that a change of one leaves the others.
    rigs, lights, looks, slopes = random.spawn(4)
    if source is not None and not keep_rig:
        source = vary_source_rig(source, rigs)
        rig = source.rig
    return SceneVariation(
        rig=rig if keep_rig or source is not None else vary_rig(rig, rigs),
        weather=weather if keep_weather else vary_weather(weather, lights),
        rare_paints=_RARE_PAINTS,
        look=None if keep_look else draw_look(looks),
        slope=draw_slope(slopes),
        source=source,
    )
