"""Rarer road users around the ego of a scene."""

from __future__ import annotations

import numpy as np

from appocc.simulation.scenario import Scenario
from appocc.simulation.town import Town
from appocc.simulation.traffic import TrafficLog
from appocc.simulation.variation.added_users import add_users
from appocc.simulation.variation.excerpt import Excerpt
from appocc.simulation.variation.exchanged_bodies import exchange_bodies


def vary_traffic(log: TrafficLog, town: Town, scenario: Scenario, seconds: float) -> TrafficLog:
    """Return the traffic of a scene with more trucks, buses, motorcycles, bicycles, and people on the road.

    Some moving cars near the ego get other bodies, and people and cyclists are added, wherever they keep clear of
    everybody else throughout the scene. The ego and the order of the actors stay; added actors come last.

    Args:
        log: traffic of the town.
        town: the town, for its lanes and its ground.
        scenario: the scene, for its ego, start and random seed.
        seconds: length of the scene.
    """
    random = np.random.default_rng([*scenario.random_seed, 5])
    scene = Excerpt.of(log, scenario.start_s, seconds, scenario.ego)
    return add_users(exchange_bodies(scene, town.ground, random), town, random).written_to(log)
