"""Helpers of tests: queries in one line, referents, and streets to resolve them in."""

from __future__ import annotations

from typing import Any

import numpy as np
from street import BLACK, BLUE, GREY, RED, WHITE, Street

from grounding.language import parse
from grounding.query import Query, Referent
from grounding.referent.resolver import Resolution, resolve
from grounding.referent.scene import SceneModel

SIZES_WLH_M = {
    "vehicle.bus.rigid": (2.9, 11.0, 3.4),
    "vehicle.truck": (2.5, 8.0, 3.2),
    "vehicle.motorcycle": (0.8, 2.2, 1.5),
    "vehicle.car": (1.8, 4.4, 1.5),
}
VAN_WLH_M = (2.0, 5.4, 2.3)


def car(colour: str | None = None, *qualifiers: str, **more: Any) -> Referent:
    """Return a car with a colour and qualifiers."""
    return Referent("car", "car", colour, qualifiers, **more)


def ask(referent: Referent, scene: SceneModel) -> Resolution:
    """Resolve a referent without an action."""
    return resolve(Query("", referent=referent), scene)


def best(found: Resolution) -> str:
    """Return the id of the resolved vehicle."""
    assert found.status == "ok", found
    return found.candidates[0].item.id


def row() -> Street:
    """Make a street: cars parked on the right, one oncoming, one driving ahead, one behind the ego."""
    street = Street().car("r1", 8, -5, RED).car("r2", 14, -5, WHITE).car("r3", 20, -5, BLUE).car("r4", 26, -5, WHITE)
    street.car("oncoming", 25, 3, BLACK, yaw_rad=np.pi, speed_mps=9.0)
    street.car("leader", 18, 0, GREY, speed_mps=6.0)
    return street.car("follower", -12, 0, RED, speed_mps=6.0)


def parse_summary(text: str) -> str:
    """Return the grammar's query of a sentence in one line: "park behind [car red left_side] right 3 m referent"."""
    query = parse(text, revised=False).query
    words = [str(query.action), query.relation]
    if query.referent is not None:
        inner = [query.referent.noun, query.referent.colour, *query.referent.qualifiers]
        words.append(f"[{' '.join(word for word in inner if word)}]")
    words += [word for word in (query.direction, query.goal_side, query.trigger) if word]
    if query.distance_m is not None:
        words.append(f"{query.distance_m:g} m {query.distance_of}")
    return " ".join(words)
