"""Built-in towns: fictional places with recorded traffic; reading them needs no SUMO."""

from __future__ import annotations

from pathlib import Path

from appocc.errors import NotFoundError
from appocc.simulation.plan import TownPlan
from appocc.simulation.town_files import load_town
from appocc.simulation.traffic import TrafficLog

TRAIN_TOWNS = ("aldermoor", "brackwater", "cindervale", "elmhollow", "fernport", "gildenmark")
TEST_TOWNS = ("harrowmere", "isenford")
TOWNS_FOLDER = Path(__file__).parent / "data" / "towns"


def load_builtin(name: str) -> tuple[TownPlan, TrafficLog]:
    """Load a built-in town and its traffic by name.

    Raises:
        NotFoundError: if the town is unknown; the message lists the known ones.
        DataError: if its files are missing or damaged.
    """
    if name not in TRAIN_TOWNS + TEST_TOWNS:
        raise NotFoundError(f"no built-in town '{name}'; there are {', '.join(TRAIN_TOWNS + TEST_TOWNS)}")
    return load_town(TOWNS_FOLDER, name)
