"""Pairs of objects: the two ends of "between", or two that are meant together."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from grounding.query import Landmark, Query
from grounding.referent.fuzzy import gaussian
from grounding.referent.predicates import to_referent
from grounding.referent.scene import SceneModel
from grounding.referent.scoring import ReferentScores, score_objects
from grounding.referent.spatial_relations import fit_between, fit_relation, footprint_gap_m, is_parted

# The two of a pair are this close; factors for pairs between which no car fits, and a third vehicle stands.
_PAIR_SIGMA_M, _NO_ROOM, _PARTED, _MAX_PAIRS = 10.0, 0.1, 0.02, 40
# Offsets across the road of two in one line.
_IN_LINE_M = 4.0
# Least fit of the other end of a pair in its relation to the first.
_LEAST_PARTNER_FIT = 0.02


class Choice(NamedTuple):
    """An object or a pair, by rows of the object table; `partner` is -1 for a single object."""

    row: int
    partner: int
    score: float


def rank_pairs(query: Query, between: Sequence[Landmark], scene: SceneModel, scores: ReferentScores) -> list[Choice]:
    """Return pairs of objects, best first: the referent and the other end of "between", or two referents."""
    table = scene.table
    other = score_objects(Query(""), to_referent(between[0]), scene) if between else scores
    rows = np.flatnonzero(scores.matches | other.matches)
    if query.relation == "between":
        fit, least = fit_between(table, rows), np.where(is_parted(table, rows), _PARTED, _NO_ROOM)
    else:
        fit, least = gaussian(footprint_gap_m(table, rows)[rows], _PAIR_SIGMA_M), np.array(_NO_ROOM)
    score = scores.log_score[rows, None] + other.log_score[rows] + np.log(least + (1 - least) * fit)
    for part in query.secondary:
        if part.of == "partner":  # "between the van and the car behind it"
            score += np.log(fit_relation(part.relation, table, rows)[rows].T + _LEAST_PARTNER_FIT)
    possible = scores.matches[rows, None] & other.matches[rows] & ~np.eye(len(rows), dtype=np.bool_)
    if not between:
        possible = np.triu(possible)
    first, second = np.nonzero(possible)
    best = np.argsort(-score[first, second], kind="stable")[:_MAX_PAIRS]
    first, second = first[best], second[best]
    value, first, second = score[first, second], rows[first], rows[second]
    if not between:
        # The better one of two referents comes first.
        swap = scores.log_score[first] < scores.log_score[second]
        first, second = np.where(swap, second, first), np.where(swap, first, second)
    return [Choice(*each) for each in zip(first.tolist(), second.tolist(), value.tolist(), strict=True)]


def in_line(pair: Choice, scene: SceneModel) -> bool:
    """Return whether a pair stands in one line along the road."""
    first, second = scene.table.lateral_m[[pair.row, pair.partner]]
    return bool(abs(first - second) < _IN_LINE_M)


def gap_m(pair: Choice, scene: SceneModel) -> float:
    """Return the gap between the footprints of a pair."""
    return float(footprint_gap_m(scene.table, np.array([pair.partner]))[pair.row, 0])


def without_chains(tied: Sequence[Choice]) -> list[Choice]:
    """Return tied choices; of pairs, those with no vehicle in common, or else those with the same one in common."""
    if tied[0].partner < 0:
        return list(tied)
    apart: list[Choice] = []
    for one in tied:
        if not any({one.row, one.partner} & {other.row, other.partner} for other in apart):
            apart.append(one)
    sharing = [[one for one in tied if row in (one.row, one.partner)] for row in (tied[0].row, tied[0].partner)]
    return apart if len(apart) > 1 else max(sharing, key=len)
