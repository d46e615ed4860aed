"""Referent resolution: find the vehicle that a query means, with ambiguity handling and near misses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from grounding.query import Query, Referent, describe_qualifier
from grounding.referent.choice_reasons import DOUBTFUL_FIT, explain_choice, explain_nearer, explain_too_few
from grounding.referent.clarification import compose_question, describe_differences, describe_one
from grounding.referent.doubts import fits_badly, lacks_class, question_about
from grounding.referent.ordinals import find_ordinals
from grounding.referent.pairs import Choice, gap_m, in_line, rank_pairs, without_chains
from grounding.referent.predicates import to_referent
from grounding.referent.rows import end_of_row, is_group, lacks_leader, names_queue
from grounding.referent.scene import SceneModel
from grounding.referent.scoring import ReferentScores, note_unmapped, score_objects
from grounding.referent.sought import by_vehicle, with_sought_referent
from grounding.road.pose import Pose2D
from grounding.scene_object import SceneObject
from grounding.vocabulary import COLOURS, KNOWN_NOUNS, PERSON_NOUNS

MAX_CANDIDATES = 6
# Candidates whose log scores differ by less than this are a tie; one that people call just so may score less by the
# second, and is taken.
_TIE_MARGIN = np.log(1.5)
_NAMED_MARGIN = np.log(3.0)
# Share of the fit of the best one in the words that one in a tie has at least.
_TIE_FIT = 0.5
# A person who is said to be at a vehicle is there with this fit at least.
_AT_VEHICLE_FIT = 0.25
# Least probability of the object that an ordinal counts to.
_LEAST_ORDINAL_PROBABILITY = 0.05
# Below this no object fits a word.
_LACKING_FIT = 0.12

ResolutionStatus = Literal["ok", "ambiguous", "not_found"]


@dataclass(frozen=True, eq=False)
class Candidate:
    """A vehicle that a query may mean.

    Attributes:
        item: the vehicle.
        fits: membership 0..1 in each word.
        score: log score, ordinals and priors included.
        partner: the second vehicle of a pair, else None.
    """

    item: SceneObject
    fits: Mapping[str, float]
    score: float
    partner: SceneObject | None = None


@dataclass(frozen=True)
class Resolution:
    """The result of referent resolution.

    Attributes:
        status: "ok" without candidates if the query names no vehicle.
        candidates: best first; the tied ones if ambiguous, near misses if not found.
        reasons: sentences that explain the result.
        question: clarification question if ambiguous, else ''.
        differences: description of each tied candidate by what distinguishes it.
    """

    status: ResolutionStatus
    candidates: tuple[Candidate, ...]
    reasons: tuple[str, ...]
    question: str = ""
    differences: tuple[str, ...] = ()


def resolve(query: Query, scene: SceneModel, limit: int = MAX_CANDIDATES) -> Resolution:
    """Resolve the referent of a query, with at most `limit` candidates."""
    named = with_sought_referent(query if scene.road is None else query.on_side(scene.road.traffic_side))
    beside = by_vehicle(named)
    people = "person" in scene.table.class_names
    sought = named if people else beside or named
    referent = sought.referent
    if referent is None:
        return (
            _ask_antecedent(sought, scene, limit)
            if query.unresolved
            else Resolution("ok", (), note_unmapped(sought, scene))
        )
    if absence := _explain_absence(referent, scene):
        stays = query.action == "wait" and referent.noun in PERSON_NOUNS  # for whom we wait needs not be known
        return Resolution("ok" if stays else "not_found", (), (absence,))
    scores = score_objects(sought, referent, scene)
    num_matches = int(scores.matches.sum())
    choices = _rank_choices(sought, referent, scene, scores) if num_matches else []
    away = not choices or scores.fit[choices[0].row] < _AT_VEHICLE_FIT
    if away and beside is not None and people:
        found = resolve(beside, scene, limit)
        return replace(
            found, reasons=(f"no '{referent.phrase()}' is seen there: its place is at the vehicle", *found.reasons)
        )
    if not choices:
        return _not_found(sought, referent, scene, scores, limit)
    if find_ordinals(referent.qualifiers) and scores.probability[choices[0].row] < _LEAST_ORDINAL_PROBABILITY:
        too_few = explain_too_few(referent, num_matches)
        return Resolution("not_found", _candidates(choices[:limit], scene, scores), (too_few, *scores.notes))
    choices = _with_named_first(referent, choices, scene)
    if lacks_leader(query, referent, choices[0].row, scene):
        return Resolution("not_found", (), ("nobody is seen ahead of us in our lane", *scores.notes))
    choices, row = _at_end_of_row(sought, referent, choices, scene, scores)
    if names_queue(referent) and not row:
        return Resolution("not_found", (), ("no queue is seen ahead of us in our lane", *scores.notes))
    fit, least_score = scores.fit, choices[0].score - _TIE_MARGIN
    least_fit = _TIE_FIT * fit[choices[0].row]  # a nearer van is no car like a farther car
    is_named = _is_named(referent, choices[0], scene)
    tied = [
        one
        for one in choices
        if one.score > least_score and fit[one.row] >= least_fit and (not is_named or _is_named(referent, one, scene))
    ]
    if len(tied) > 1 and tied[0].partner >= 0 and query.relation == "between":
        roomy = [one for one in tied if gap_m(one, scene) >= scene.ego.length_m and in_line(one, scene)]
        if not roomy:
            return Resolution(
                "not_found", (), (f"no two that fit '{referent.phrase()}' leave room for us", *scores.notes)
            )
        tied, choices = roomy, [*roomy, *(one for one in choices if one not in roomy)]
    if len(tied) > 1 and referent.definite and not is_group(referent, [one.row for one in tied], scene):
        listed = _candidates(without_chains(tied)[:limit], scene, scores)
        asked = _ambiguous(referent, listed, len(tied), scene, scores)
        absent = all(lacks_class(referent, one.row, _fits_of(one, scores), scene) for one in tied)
        none_seen = f"no {referent.head} is seen: " if absent else ""
        return replace(asked, question=none_seen + asked.question)
    candidates = _candidates(choices[:limit], scene, scores)
    question = question_about(sought, referent, choices[0].row, candidates[0].fits, scene)
    if question and fits_badly(referent, choices[0].row, candidates[0].fits, scene):
        candidates, question = _ask_about_fitting(sought, referent, choices, scene, scores) or (candidates, question)
    if question:
        described = describe_one(candidates[0].item, scene)
        reason = f"what fits '{referent.phrase()}' best is {described}"
        return Resolution("ambiguous", candidates[:1], (reason, *scores.notes), question, (described,))
    reasons = [row] if row else explain_choice(referent, num_matches, candidates[0].item, candidates[0].fits, scene)
    if sought is not named:
        reasons.insert(0, f"no people are known here: '{referent.phrase()}' tells where")
    reasons += explain_nearer(referent, choices[0].row, scores, scene)
    return Resolution("ok", candidates, (*reasons, *scores.notes))


def resolve_after_turn(query: Query, scene: SceneModel, after: Pose2D, limit: int = MAX_CANDIDATES) -> Resolution:
    """Resolve a referent that is spoken of as it is seen once the ego has turned off to a pose; else from here."""
    by_map = any(part.of == "referent" and part.noun not in KNOWN_NOUNS for part in query.secondary)
    found = resolve(query, scene if by_map else scene.seen_from(after), limit)
    if found.status == "not_found" or (found.question and len(found.candidates) < 2):
        return resolve(query, scene, limit)
    here = {item.id: item for item in (*scene.objects, *scene.others)}
    candidates = tuple(
        replace(one, item=here[one.item.id], partner=here[one.partner.id] if one.partner else None)
        for one in found.candidates
    )
    if found.status == "ok":
        return replace(found, candidates=candidates)
    question, differences = _tell_apart(candidates, scene)
    return replace(found, candidates=candidates, question=question, differences=differences)


def _at_end_of_row(
    query: Query, referent: Referent, choices: list[Choice], scene: SceneModel, scores: ReferentScores
) -> tuple[list[Choice], str]:
    """Return the end of the row that several vehicles form, and why it is taken; else the choices, and ''."""
    least_fit = _TIE_FIT * scores.fit[choices[0].row]
    fitting = [one.row for one in choices if scores.fit[one.row] >= least_fit]
    found = end_of_row(query, referent, fitting, scene)
    if found is None:
        return choices, ""
    chosen = next(one for one in choices if one.row == found[0])
    if found[1] == 1:
        return [chosen], f"it alone fits '{referent.phrase()}' in our lane"
    return [chosen], f"it is at the end of a row of {found[1]} that fit '{referent.phrase()}'"


def _with_named_first(referent: Referent, choices: list[Choice], scene: SceneModel) -> list[Choice]:
    """Return choices with those first that people call just so, if they score nearly as the best one."""
    rivals = [one for one in choices if one.score > choices[0].score - _NAMED_MARGIN]
    named = [one for one in rivals if _is_named(referent, one, scene)]
    return [*named, *(one for one in choices if one not in named)]


def _is_named(referent: Referent, choice: Choice, scene: SceneModel) -> bool:
    """Return whether people call an object by the very noun and colour."""
    item = scene.table.items[choice.row]
    shown = scene.colour_name(item) or ""
    coloured = COLOURS.get((referent.colour or "").split(" ")[-1], "")
    return (not coloured or coloured in shown.split(" or ")) and item.common_name in (referent.noun, "vehicle")


def _ask_about_fitting(
    query: Query, referent: Referent, choices: Sequence[Choice], scene: SceneModel, scores: ReferentScores
) -> tuple[tuple[Candidate, ...], str] | None:
    """Return the best object that all words fit and that is out of sight, and the question about it; else None."""
    for one in choices:
        if all(fit[one.row] >= DOUBTFUL_FIT for fit in scores.word_fits.values()):
            candidates = _candidates([one], scene, scores)
            question = question_about(query, referent, one.row, candidates[0].fits, scene)
            return (candidates, question) if question else None
    return None


def with_partner(chosen: Candidate, query: Query, scene: SceneModel) -> Candidate:
    """Return a settled vehicle with the other end of "between" that fits best, unchanged without one."""
    if query.relation != "between" or chosen.partner is not None:
        return chosen
    sought = with_sought_referent(query)
    if sought.referent is None:
        return chosen
    scores = score_objects(sought, sought.referent, scene)
    pairs = _rank_choices(sought, sought.referent, scene, scores)
    ours = [one for one in pairs if one.partner >= 0 and scene.table.items[one.row].id == chosen.item.id]
    return _candidates(ours[:1], scene, scores)[0] if ours else chosen


def word_probabilities(query: Query, scene: SceneModel) -> dict[str, float]:
    """Return id -> probability of each object that matches the referent's words; no prior counts."""
    sought = with_sought_referent(query)
    if sought.referent is None or _explain_absence(sought.referent, scene):
        return {}
    scores = score_objects(sought, sought.referent, scene)
    return {scene.table.items[row].id: float(scores.probability[row]) for row in np.flatnonzero(scores.matches)}


def find_all(referent: Referent, scene: SceneModel) -> tuple[SceneObject, ...]:
    """Return all objects that a description fits without doubt, nearest first."""
    if _explain_absence(referent, scene):
        return ()
    scores = score_objects(Query(""), referent, scene)
    sure = scores.matches & np.all([fit >= DOUBTFUL_FIT for fit in scores.word_fits.values()], axis=0)
    rows = np.flatnonzero(sure)
    nearest = rows[np.argsort(scene.table.distance_m[rows], kind="stable")]
    return tuple(scene.table.items[row] for row in nearest.tolist())


def _ask_antecedent(query: Query, scene: SceneModel, limit: int) -> Resolution:
    """Return the question which vehicle a pronoun refers to, with the most salient ones as candidates."""
    any_vehicle = query.sought or Referent("vehicle", query.unresolved)
    reason = f"'{query.unresolved}' refers to nothing that was named"
    scores = score_objects(query, any_vehicle, scene) if scene.objects else None
    choices = _rank_choices(query, any_vehicle, scene, scores) if scores and scores.matches.any() else []
    if scores is None or not choices:
        return Resolution("not_found", (), (reason,))
    candidates = _candidates(without_chains(choices)[:limit], scene, scores)
    if len(candidates) == 1:
        described = describe_one(candidates[0].item, scene)
        return Resolution("ambiguous", candidates, (reason,), f"do you mean {described}?", (described,))
    asked = _ambiguous(any_vehicle, candidates, len(candidates), scene, scores)
    return replace(asked, reasons=(reason,))


def _explain_absence(referent: Referent, scene: SceneModel) -> str:
    """Return why a scene cannot hold the referent at all; '' if it can."""
    if referent.noun in PERSON_NOUNS:
        return "" if "person" in scene.table.class_names else "only vehicles are known here, and no people"
    if not scene.objects and not (referent.noun == "bicycle" and scene.others):
        return "no vehicle is known here" if scene.bev is None else "the map shows no vehicle"
    return ""


def _rank_choices(query: Query, referent: Referent, scene: SceneModel, scores: ReferentScores) -> list[Choice]:
    """Return the matching objects or pairs, best first."""
    named = [part for part in query.secondary if part.relation == "between" and part.of == "goal"]
    between = [part for part in named if part.noun in KNOWN_NOUNS]
    if referent.number != 2 and (query.relation != "between" or (named and not between)):
        rows = np.flatnonzero(scores.matches)
        order = rows[np.argsort(-scores.log_score[rows], kind="stable")].tolist()
        return [Choice(i, -1, float(scores.log_score[i])) for i in order]
    return rank_pairs(query, between, scene, scores)


def _fits_of(choice: Choice, scores: ReferentScores) -> dict[str, float]:
    return {word: float(fit[choice.row]) for word, fit in scores.word_fits.items()}


def _candidates(choices: Sequence[Choice], scene: SceneModel, scores: ReferentScores) -> tuple[Candidate, ...]:
    items = scene.table.items
    return tuple(
        Candidate(
            items[choice.row],
            _fits_of(choice, scores),
            choice.score,
            items[choice.partner] if choice.partner >= 0 else None,
        )
        for choice in choices
    )


def _ambiguous(
    referent: Referent, candidates: tuple[Candidate, ...], num_tied: int, scene: SceneModel, scores: ReferentScores
) -> Resolution:
    plural = "people" if referent.noun in PERSON_NOUNS else "pairs" if candidates[0].partner else "vehicles"
    reason = f"{num_tied} {plural} fit '{referent.phrase()}' about equally well"
    question, differences = _tell_apart(candidates, scene)
    return Resolution("ambiguous", candidates, (reason, *scores.notes), question, differences)


def _tell_apart(candidates: tuple[Candidate, ...], scene: SceneModel) -> tuple[str, tuple[str, ...]]:
    """Return the question which of the candidates is meant, and how they differ."""
    shared = _shared_by_all(candidates)
    groups = [tuple(item for item in (one.item, one.partner) if item and item is not shared) for one in candidates]
    differences = describe_differences(groups, scene)
    question = compose_question(differences)
    if shared is not None:
        question = f"{describe_one(shared, scene)}, and which other one: {question}"
    return question, differences


def _shared_by_all(candidates: Sequence[Candidate]) -> SceneObject | None:
    """Return the vehicle that stands in every pair; None if there is none."""
    for item in (candidates[0].item, candidates[0].partner):
        if candidates[0].partner is not None and all(item in (one.item, one.partner) for one in candidates):
            return item
    return None


def _not_found(query: Query, referent: Referent, scene: SceneModel, scores: ReferentScores, limit: int) -> Resolution:
    """Return the near misses, and the words that no object fits."""
    word_fits = np.stack(list(scores.word_fits.values()))
    reasons = [f"nothing here fits '{referent.phrase()}'"]
    if scores.matches.any():
        reasons = [_explain_no_pair(query, referent, scores)]
    lacks = (word for word, fit in scores.word_fits.items() if float(fit.max()) < _LACKING_FIT)
    lacking = [describe_qualifier(word.replace(" ", "_")) for word in lacks]
    reasons += [
        f"none of the {len(scene.table)} here is '{describe_qualifier(word.replace(' ', '_'))}'" for word in lacking
    ]
    # The mean ranks objects that miss one word before objects that miss all.
    order = np.lexsort((scene.table.distance_m, -word_fits.mean(axis=0).round(1)))[: limit // 2]
    product = np.log(scores.fit + 1e-9)
    misses = [Choice(i, -1, float(product[i])) for i in order.tolist()]
    return Resolution("not_found", _candidates(misses, scene, scores), (*reasons, *scores.notes))


def _explain_no_pair(query: Query, referent: Referent, scores: ReferentScores) -> str:
    """Explain why no pair was found though single objects match."""
    named = [part for part in query.secondary if part.relation == "between" and part.noun in KNOWN_NOUNS]
    if named:
        return f"nothing here fits '{to_referent(named[0]).phrase()}', to be between it and '{referent.phrase()}'"
    return f"only {int(scores.matches.sum())} here fits '{referent.phrase()}', and two are asked for"
