"""Rows and groups: which vehicle of a row or a queue a place is measured from, and who stands together."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from appocc.motion_state import MOVING_MPS
from grounding.query import Query, Referent
from grounding.referent.ordinals import find_ordinals, is_plural, lead_side
from grounding.referent.priors import GROUP_M
from grounding.referent.scene import SceneModel
from grounding.road.lane_model import LANE_M
from grounding.vocabulary import PASSING_ACTIONS

# Places beyond a row, and short of it; actions that pass one.
_BEYOND, _SHORT = ("past", "in_front_of"), ("behind", "before", "toward")
# Nouns for all the vehicles of a row.
_QUEUES = ("queue", "tailback", "jam", "line", "string", "stream")
# Vehicles of a row leave at most this much room between them, and are this much in line.
_GAP_M, _ASIDE_M = 15.0, 2.0


def names_queue(referent: Referent) -> bool:
    """Return whether a referent is a queue as a whole, not one vehicle."""
    return bool({*referent.head.split()} & {*_QUEUES})


def is_group(referent: Referent, rows: Sequence[int], scene: SceneModel) -> bool:
    """Return whether several objects, by their rows of the object table, are those that are meant together."""
    if not is_plural(referent.head) or referent.number != 1 or find_ordinals(referent.qualifiers):
        return False
    xy_m = scene.table.xy_m[list(rows)]
    return bool(np.linalg.norm(xy_m - xy_m[0], axis=1).max() < GROUP_M)


def end_of_row(query: Query, referent: Referent, rows: Sequence[int], scene: SceneModel) -> tuple[int, int] | None:
    """Return the first or last vehicle of a row, as the relation of the command needs it, and the row's length.

    Args:
        query: the command.
        referent: the row or queue that is named.
        rows: objects that fit, best first, by rows of the object table; the first one that heads our way, if any
            does, is part of the row.
        scene: the scene.

    Returns:
        The vehicle, by its row of the object table, and the number of vehicles; None if one vehicle is meant, or if
        there is no row.
    """
    beyond = query.relation in _BEYOND or (query.action in PASSING_ACTIONS and query.relation == "none")
    queue = names_queue(referent)
    if not (beyond or query.relation in _SHORT) or not (queue or is_plural(referent.head)) or not referent.definite:
        return None
    if referent.number != 1 or referent.anaphora or find_ordinals(referent.qualifiers):
        return None
    with_us = [row for row in rows if np.cos(scene.table.relative_heading_rad[row]) > 0]
    if queue:
        with_us = rows = [row for row in with_us if is_before_us(row, scene)]
    members = _row_of(with_us or rows, scene)
    if len(members) < (1 if queue else 2):
        return None
    along = scene.table.along_m
    return (max if beyond else min)(members, key=lambda row: along[row]), len(members)


def lacks_leader(query: Query, referent: Referent, row: int, scene: SceneModel) -> bool:
    """Return whether "the car in front" is to be followed or overtaken, and the best is parked beside our lane."""
    leads = query.action in ("follow", "overtake") and lead_side(referent) > 0
    speed = scene.table.speed_mps[row]
    return bool(leads and not is_before_us(row, scene) and np.nan_to_num(speed) < MOVING_MPS)


def is_before_us(row: int, scene: SceneModel) -> bool:
    """Return whether an object is ahead of us in our lane, by its row of the object table."""
    table = scene.table
    return bool(abs(table.lateral_m[row]) < LANE_M / 2 and table.xy_m[row, 0] > scene.ego.centre_m)


def _row_of(rows: Sequence[int], scene: SceneModel) -> list[int]:
    """Return the vehicles in line with the first, each near enough to the next."""
    if not rows:
        return []
    table, first = scene.table, rows[0]
    in_line = [row for row in rows if abs(table.lateral_m[row] - table.lateral_m[first]) < _ASIDE_M]
    in_line.sort(key=lambda row: table.along_m[row])
    along, half = table.along_m[in_line], table.size_m[in_line, 0] / 2
    breaks = np.flatnonzero(np.diff(along) - half[1:] - half[:-1] > _GAP_M) + 1
    parts = np.split(np.array(in_line), breaks)
    return next([int(row) for row in part] for part in parts if first in part)
