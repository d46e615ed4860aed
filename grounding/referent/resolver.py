"""Which vehicle a query means, and honesty about ties and about what is not there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from grounding.query import Landmark, Query, Referent
from grounding.referent.clarification import ask, tell_apart
from grounding.referent.class_fit import KNOWN, PEOPLE, VEHICLES
from grounding.referent.fuzzy import bell
from grounding.referent.ordinals import counting_words
from grounding.referent.predicates import described
from grounding.referent.scene import Scene
from grounding.referent.scoring import Weighed, unknown_things, weigh
from grounding.referent.spatial_relations import gaps, room_between
from grounding.scene_object import SceneObject

# Two whose scores differ by less are a tie.
_MARGIN = np.log(2.0)
# Below this no vehicle is the one counted to: there are too few.
_LEAST_CHANCE = 0.05
# What a word leaves of a vehicle that it does not fit, and of one that it hardly fits.
_LACKING, _DOUBTFUL = 0.12, 0.35
# Two that are meant together stand together; what is left of them where no car fits between.
_TOGETHER_M, _NO_ROOM, _MOST_PAIRS = 10.0, 0.1, 40


@dataclass(frozen=True)
class Candidate:
    """A vehicle that may be meant.

    Attributes:
        item: the vehicle.
        fits: each thing said of it, and how well it fits, 0..1.
        score: logarithm of how well it fits all in all, its place in the count included.
        partner: the other vehicle, where two are meant.
    """

    item: SceneObject
    fits: Mapping[str, float]
    score: float
    partner: SceneObject | None = None


@dataclass(frozen=True)
class Resolution:
    """Which vehicle is meant.

    Attributes:
        status: ok, ambiguous or not_found; ok without candidates where no vehicle is named.
        candidates: best first; those that tie where it is ambiguous, near misses where none fits.
        reasons: sentences that say why.
        question: the one question that would decide, where it is ambiguous.
        differences: of each tied candidate, what it has and the others do not.
    """

    status: str
    candidates: tuple[Candidate, ...]
    reasons: tuple[str, ...]
    question: str = ""
    differences: tuple[str, ...] = ()


class _Choice(NamedTuple):
    """A thing, or two of them, by their numbers; `partner` is -1 where one is meant."""

    row: int
    partner: int
    score: float


def resolve(query: Query, scene: Scene, limit: int = 6) -> Resolution:
    """The vehicle that a query means."""
    asked = _as_sought(query)
    referent = asked.referent
    if referent is None:
        return Resolution("ok", (), unknown_things(asked))
    if absent := _absent(referent, scene):
        return Resolution("not_found", (), (absent,))
    weighed = weigh(asked, referent, scene)
    matching = int(weighed.matches.sum())
    choices = _choices(asked, referent, scene, weighed) if matching else []
    if not choices:
        return _nothing(asked, referent, scene, weighed, limit)
    if counting_words(referent.qualifiers) and weighed.chance[choices[0].row] < _LEAST_CHANCE:
        return Resolution(
            "not_found",
            _candidates(choices[:limit], scene, weighed),
            (_too_few(referent, matching), *weighed.notes),
        )
    tied = [choice for choice in choices if choice.score > choices[0].score - _MARGIN]
    if len(tied) > 1 and referent.definite:
        return _ambiguous(referent, _candidates(tied[:limit], scene, weighed), len(tied), scene, weighed)
    candidates = _candidates(choices[:limit], scene, weighed)
    return Resolution("ok", candidates, (*_why(referent, matching, candidates[0], scene), *weighed.notes))


def forbidden(query: Query, scene: Scene) -> tuple[tuple[str, SceneObject], ...]:
    """Where a place may not be: relations, and the vehicles that they are to."""
    found: list[tuple[str, SceneObject]] = []
    for part in query.excluded:
        if part.relation is not None and part.noun in KNOWN and len(scene.crowd):
            weighed = weigh(Query(""), described(part), scene)
            meant = weighed.matches & (weighed.chance >= weighed.chance.max() / 3)
            found += [(part.relation, scene.crowd.items[i]) for i in np.flatnonzero(meant).tolist()]
    return tuple(found)


def _as_sought(query: Query) -> Query:
    """The query with the thing to look for as its referent; riders and drivers are part of their vehicles."""
    referent, secondary = query.referent, query.secondary
    if referent is None:
        named = [part for part in secondary if part.of == "goal" and part.noun in KNOWN][:1]
        return replace(query, referent=described(named[0]), secondary=_without(named, secondary)) if named else query
    inside = [part for part in secondary if part.relation in ("on", "in")]
    if referent.noun in PEOPLE:
        ridden = [part for part in inside if part.of == "referent" and part.noun in VEHICLES][:1]
        if ridden:
            part = ridden[0]
            vehicle = replace(referent, noun=part.noun, head=described(part).head, colour=part.colour)
            return replace(query, referent=vehicle, secondary=_without(ridden, secondary))
    riders = [part for part in inside if part.of == "inverse" and part.noun in PEOPLE]
    return replace(query, secondary=_without(riders, secondary))


def _without(some: Sequence[Landmark], landmarks: tuple[Landmark, ...]) -> tuple[Landmark, ...]:
    return tuple(part for part in landmarks if part not in some)


def _absent(referent: Referent, scene: Scene) -> str:
    """Why nothing of the kind can be found in a scene at all; empty if something might."""
    if referent.noun in PEOPLE:
        return "" if "person" in scene.crowd.kind else "only vehicles are known here, and no people"
    if not scene.objects and not (referent.noun == "bicycle" and scene.others):
        return "no vehicle is known here" if scene.bev is None else "the map shows no vehicle"
    return ""


def _choices(query: Query, referent: Referent, scene: Scene, weighed: Weighed) -> list[_Choice]:
    """Things or pairs of them that the words fit, best first."""
    named = [part for part in query.secondary if part.relation == "between" and part.of == "goal"]
    between = [part for part in named if part.noun in KNOWN]
    if referent.number != 2 and (query.relation != "between" or (named and not between)):
        rows = np.flatnonzero(weighed.matches)
        order = rows[np.argsort(-weighed.score[rows], kind="stable")].tolist()
        return [_Choice(i, -1, float(weighed.score[i])) for i in order]
    return _pairs(query, between, scene, weighed)


def _pairs(query: Query, between: Sequence[Landmark], scene: Scene, weighed: Weighed) -> list[_Choice]:
    """Two things each, best first: those that a query asks for, and those that it names as the other ones."""
    crowd = scene.crowd
    other = weigh(Query(""), described(between[0]), scene) if between else weighed
    rows = np.flatnonzero(weighed.matches | other.matches)
    fit = room_between(crowd, rows) if query.relation == "between" else bell(gaps(crowd, rows)[rows], _TOGETHER_M)
    score = weighed.score[rows, None] + other.score[rows] + np.log(_NO_ROOM + (1 - _NO_ROOM) * fit)
    possible = weighed.matches[rows, None] & other.matches[rows] & ~np.eye(len(rows), dtype=np.bool_)
    if not between:
        possible = np.triu(possible)
    first, second = np.nonzero(possible)
    best = np.argsort(-score[first, second], kind="stable")[:_MOST_PAIRS]
    first, second = first[best], second[best]
    value, first, second = score[first, second], rows[first], rows[second]
    if not between:
        # Of two alike the better one leads.
        swap = weighed.score[first] < weighed.score[second]
        first, second = np.where(swap, second, first), np.where(swap, first, second)
    return [_Choice(*each) for each in zip(first.tolist(), second.tolist(), value.tolist(), strict=True)]


def _candidates(choices: Sequence[_Choice], scene: Scene, weighed: Weighed) -> tuple[Candidate, ...]:
    items = scene.crowd.items
    return tuple(
        Candidate(
            items[choice.row],
            {word: float(fit[choice.row]) for word, fit in weighed.said.items()},
            choice.score,
            items[choice.partner] if choice.partner >= 0 else None,
        )
        for choice in choices
    )


def _ambiguous(
    referent: Referent, candidates: tuple[Candidate, ...], count: int, scene: Scene, weighed: Weighed
) -> Resolution:
    what = "people" if referent.noun in PEOPLE else "pairs" if candidates[0].partner else "vehicles"
    groups = [(one.item,) if one.partner is None else (one.item, one.partner) for one in candidates]
    differences = tell_apart(groups, scene)
    reason = f"{count} {what} fit '{referent.phrase()}' about equally well"
    return Resolution("ambiguous", candidates, (reason, *weighed.notes), ask(differences), differences)


def _nothing(query: Query, referent: Referent, scene: Scene, weighed: Weighed, limit: int) -> Resolution:
    """Nothing fits: the nearest misses, and what of the words no vehicle allows for."""
    said = np.stack(list(weighed.said.values()))
    reasons = [f"nothing here fits '{referent.phrase()}'"]
    if weighed.matches.any():
        reasons = [_no_pair(query, referent, scene, weighed)]
    lacking = [word for word, fit in weighed.said.items() if float(fit.max()) < _LACKING]
    reasons += [f"none of the {len(scene.crowd)} here is '{word}'" for word in lacking]
    # The mean keeps an order among things that miss by one word and those that miss by all.
    order = np.lexsort((scene.crowd.distance_m, -said.mean(axis=0).round(1)))[: limit // 2]
    product = np.log(said.prod(axis=0) + 1e-9)
    misses = [_Choice(i, -1, float(product[i])) for i in order.tolist()]
    return Resolution("not_found", _candidates(misses, scene, weighed), (*reasons, *weighed.notes))


def _no_pair(query: Query, referent: Referent, scene: Scene, weighed: Weighed) -> str:
    """Why there are no two vehicles, though there is one."""
    named = [part for part in query.secondary if part.relation == "between" and part.noun in KNOWN]
    if named:
        return f"nothing here fits '{described(named[0]).phrase()}', to be between it and '{referent.phrase()}'"
    return f"only {int(weighed.matches.sum())} here fits '{referent.phrase()}', and two are asked for"


def _too_few(referent: Referent, matching: int) -> str:
    words = counting_words(referent.qualifiers)
    return f"no vehicle is the '{' '.join(words)}' one: {matching} fit the rest of '{referent.phrase()}'"


def _why(referent: Referent, matching: int, best: Candidate, scene: Scene) -> list[str]:
    """What was counted, in words, and what speaks against it."""
    one, several = ("person", "people") if referent.noun in PEOPLE else ("vehicle", "vehicles")
    reasons = [f"it fits '{referent.phrase()}' best of {matching} {several}"]
    if matching == 1:
        reasons = [f"it is the only {one} that fits '{referent.phrase()}'"]
    elif not referent.definite:
        reasons = [f"any of {matching} {several} would do: the one that fits best and lies near was taken"]
    if referent.colour and best.item.rgb is None:
        reasons.append(f"its colour is not known: '{referent.colour}' could not be checked")
    elif referent.colour and best.fits[referent.colour] < _DOUBTFUL:
        reasons.append(f"its colour looks {scene.colour_name(best.item)} rather than {referent.colour}")
    return reasons
