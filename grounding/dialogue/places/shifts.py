"""Replies that move the goal in force, or change its distance: "a bit further", "too close to the crossing"."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from grounding.answer import Answer
from grounding.answering import accept_proposal
from grounding.dialogue.choices import confirm
from grounding.dialogue.clauses import clauses_of, is_phrase
from grounding.dialogue.conversation import Conversation
from grounding.dialogue.descriptions import widen
from grounding.dialogue.fragments import read_description
from grounding.dialogue.merging import merge_request
from grounding.dialogue.telling.phrases import said
from grounding.dialogue.telling.reports import ask_again, inform
from grounding.goal.explanations import gap_beyond_m
from grounding.goal.planner import Target
from grounding.goal.shift import Shift
from grounding.language.replies import Reply
from grounding.query import Direction, Query
from grounding.referent.resolver import resolve
from grounding.requests import STOPS, Request, requests_of
from grounding.road.lane_model import LANE_M
from grounding.vocabulary import LANDMARK_KINDS, Relation, ShiftDirection

# Words of a place that is too far away.
_TOO_FAR = re.compile(r"\b(?:too|so|that) far\b(?! (?:from|to the|off the|away from))")
# Distance of "a bit", the same across our lane, and distances to another place than the goal.
BIT_M, _ASIDE_M = 2.0, 0.5
_ELSEWHERE_M = (6.0, 12.0, 18.0, 24.0)
# Relations in line with a vehicle, by those at its other end.
_OTHER_ENDS: Mapping[str, Relation] = {
    **{"past": "before", "before": "past"},
    **{"in_front_of": "behind", "behind": "in_front_of"},
}
# The sides of shifts across our lane, and the opposite of each shift.
_SIDES: Mapping[str, Direction] = {"leftwards": "left", "rightwards": "right"}
_OPPOSITE: dict[ShiftDirection, ShiftDirection] = {
    **{"away": "near", "near": "away", "ahead": "back", "back": "ahead"},
    **{"leftwards": "rightwards", "rightwards": "leftwards"},
}


def offers_place(talk: Conversation) -> bool:
    """Return whether the open question offers another place than the one that was asked for."""
    question = talk.state.question
    return question is not None and bool(question.plan.question) and question.plan.nearest is not None


def accepted_offer(talk: Conversation) -> Request | None:
    """Return the step with the place on offer, as if that was agreed to; None if no place is on offer."""
    question, request = talk.state.question, talk.state.request
    if question is None or request is None or question.plan.instead is not None or not offers_place(talk):
        return None
    return accept_proposal(request, question)


def place_in_talk(talk: Conversation) -> Target | None:
    """Return the place on offer, or else the place of the goal in force; None without one."""
    question, goal = talk.state.question, talk.state.goal
    if question is not None and offers_place(talk):
        return question.plan.nearest
    return goal.target if goal is not None else None


def usual_shift_m(talk: Conversation, text: str) -> float:
    """Return how far a place is moved that no turn says: a bit, or a third of the way to it if it is too far."""
    place = place_in_talk(talk)
    if place is None or _TOO_FAR.search(text.lower()) is None:
        return BIT_M
    return max(BIT_M, _ahead_m(talk, place) / 3)


def shift_last(talk: Conversation, text: str, shift: Shift) -> Answer:
    """Move the place on offer, which is agreed to then, or else the goal in force."""
    state, offered = talk.state, accepted_offer(talk)
    if offered is None and (not state.plan or state.goal is None):
        return ask_again(talk, text)
    last = offered or state.plan[-1]
    moved = replace(last, shifts=(*last.shifts, shift), reading=said(last.reading, text))
    steps = state.with_request(moved) if offered else (*state.plan[:-1], moved)
    answer = talk.answer_steps(steps, state.at if offered else -1)
    if answer.status == "ok":
        return talk.settle(steps, answer)
    if offered is not None:
        return replace(ask_again(talk, text), reasons=(f"there is no room {shift.words} of that place",))
    if shift == Shift("ahead", BIT_M) and last.chosen is None and last.query.action in STOPS:
        farther = move_elsewhere(talk, text, ("ahead",))
        if farther.status == "ok":  # "a bit further" along a full kerb
            return replace(farther, reasons=(*farther.reasons, "there is no room nearer than that"))
    if shift.distance_m == BIT_M:
        return inform(talk, text, f"there is no room {shift.words}: the goal stays where it was")
    return replace(answer, reasons=(*answer.reasons, "the goal stays where it was"))


def shift_place(talk: Conversation, text: str, reply: Reply, shift: Shift) -> Answer:
    """Move the place in talk with respect to what a turn names, or to us, or else as the shift says."""
    if moved := shift_from_named(talk, text, reply) or _take_lane(talk, text, shift):
        return moved
    place = place_in_talk(talk)
    if shift.direction not in ("near", "away") or place is None or not _names_us(talk, text):
        return shift_last(talk, text, shift)
    if shift.direction == "near" and (answer := _take_near_end(talk, text, place)):
        return answer
    approaches = _ahead_m(talk, place) > 0
    return shift_last(
        talk, text, replace(shift, direction="back" if approaches == (shift.direction == "near") else "ahead")
    )


def _take_lane(talk: Conversation, text: str, shift: Shift) -> Answer | None:
    """Take the side that a turn names for a change of lane in force without one; None without such a goal."""
    last, side = talk.state.plan[-1] if talk.state.plan else None, _SIDES.get(shift.direction)
    if last is None or side is None or last.query.action != "change_lane" or last.query.direction or last.shifts:
        return None
    reading = said(last.reading.with_query(replace(last.query, direction=side)), text)
    return talk.take((*talk.state.plan[:-1], *requests_of(reading)))


def _names_us(talk: Conversation, text: str) -> bool:
    """Return whether a clause of a turn ends in where we are: "closer to us"."""
    return any(is_phrase("tous", words[i:]) for words in clauses_of(talk, text) for i in range(len(words)))


def _ahead_m(talk: Conversation, place: Target) -> float:
    """Return how far a place is ahead of us along its heading."""
    along = np.array([np.cos(place.heading_ego_rad), np.sin(place.heading_ego_rad)])
    return float((place.ego_m - [talk.scene.ego.centre_m, 0.0]) @ along)


def _take_near_end(talk: Conversation, text: str, place: Target) -> Answer | None:
    """Take the other end of the vehicle of the last command, if that is nearer to us; None where it is not."""
    request = talk.state.request
    relation = _OTHER_ENDS.get(request.query.relation) if request is not None else None
    if request is None or relation is None or request.query.landmark != "referent":
        return None
    query = Query(text, relation=relation, landmark="referent")
    steps = talk.state.with_request(
        replace(merge_request(request, query), chosen=request.chosen, held=None, shifts=())
    )
    answer = talk.answer_steps(steps, talk.state.at)
    if answer.status != "ok" or answer.target is None:
        return None
    nearer = abs(_ahead_m(talk, answer.target)) < abs(_ahead_m(talk, place))
    return talk.settle(steps, answer) if nearer else None


def move_elsewhere(talk: Conversation, text: str, directions: Sequence[ShiftDirection] = ("ahead", "back")) -> Answer:
    """Move the goal in force to the nearest other place that will do, along our way."""
    answers = []
    for distance_m in _ELSEWHERE_M:
        for direction in directions:
            answers.append(shift_last(talk, text, Shift(direction, distance_m, whole=True)))
            if answers[-1].status == "ok":
                return answers[-1]
    return answers[0]


def shift_from_named(talk: Conversation, text: str, reply: Reply) -> Answer | None:
    """Move the goal in force with respect to a vehicle, a landmark of the road or the kerb; None without one.

    "Closer to the black one", "that's too close to the crossing", "a bit further from the kerb".
    """
    direction, state = reply.leading_shift, talk.state
    preposition, _, named = reply.rest.partition(" ")
    lists = state.question is not None and not offers_place(talk)
    if direction is None or preposition not in ("to", "from") or lists or place_in_talk(talk) is None:
        return None
    distance_m = reply.distance_m or BIT_M
    reading = read_description(named, talk.antecedent, talk.readings)
    found = resolve(widen(reading, talk.scene).query, talk.scene) if reading else None
    vehicle = talk.in_focus(reading.query) if reading else None
    if vehicle is None and found is not None and found.status == "ok":
        vehicle = found.candidates[0]
    if vehicle is not None:
        return shift_last(talk, text, Shift(direction, distance_m, vehicle.item.id))
    if direction not in ("near", "away"):
        return None
    said = talk.readings(f"stop at {named}", talk.antecedent)[0].query
    toward = _direction_to_part_of_road(talk, said)
    if toward is None and said.secondary and said.referent is None:
        thing = said.secondary[0].noun.replace("_", " ")
        return inform(talk, text, f"the map shows no {thing} on our way: say how far ahead or back")
    if toward is None:
        return None
    return shift_last(talk, text, Shift(toward if direction == "near" else _OPPOSITE[toward], distance_m))


def move_in_lane(talk: Conversation, text: str, reply: Reply) -> Answer | None:
    """Drive on in our lane a little to one side: "keep left a touch" without a goal; None for other turns.

    "A bit closer to the kerb" is one, and "move left" a change of lane.
    """
    direction = reply.shift or reply.leading_shift
    aside = direction in ("leftwards", "rightwards")
    if not talk.is_opening or not (aside or reply.rest.startswith(("to ", "from "))):
        return None
    if aside and reply.rest and not talk.readings(reply.rest, alone=False)[0].problem:
        return None  # another wish follows, and no reason
    before = talk.state
    steps = requests_of(talk.readings("carry on")[0])
    if talk.take(steps).status == "ok":
        shift = Shift(direction, reply.distance_m or _ASIDE_M) if aside and direction else None
        moved = shift_last(talk, text, shift) if shift else _shift_from_kerb(talk, text, reply)
        if moved is not None and talk.state.plan[-1].shifts:
            return moved
    talk.state = before
    return None


def _shift_from_kerb(talk: Conversation, text: str, reply: Reply) -> Answer | None:
    """Move the goal in force towards the kerb or away from it; None where no kerb is named."""
    named = talk.readings(f"stop at {reply.rest.partition(' ')[2]}")[0].query
    toward = _direction_to_part_of_road(talk, named) if named.road_side == "kerb" else None
    if toward is None or reply.leading_shift not in ("near", "away"):
        return None
    direction = toward if reply.leading_shift == "near" else _OPPOSITE[toward]
    return shift_last(talk, text, Shift(direction, reply.distance_m or _ASIDE_M))


def _direction_to_part_of_road(talk: Conversation, named: Query) -> ShiftDirection | None:
    """Return where a landmark of the road, or the kerb, lies from the place in talk; None if a query names none."""
    target, road = place_in_talk(talk), talk.scene.road
    if target is None or road is None:
        return None
    along_m, lateral_m = (float(each) for each in road.ego_lane.project(target.ego_m))
    with_us = np.cos(target.heading_ego_rad - road.direction_at(target.ego_m)) > 0
    if named.road_side == "kerb":
        on_our_side = road.traffic_side * lateral_m < LANE_M / 2
        return "rightwards" if (road.traffic_side > 0) == (on_our_side == with_us) else "leftwards"
    kind = next((LANDMARK_KINDS[one.noun] for one in named.secondary if one.noun in LANDMARK_KINDS), "")
    spans = road.landmarks.spans(kind, road.ego_lane)
    if not spans:
        return None
    nearest = min(spans, key=lambda span: max(span.near_m - along_m, along_m - span.far_m))
    return "ahead" if (nearest.near_m > along_m) == with_us else "back"


def shift_more(talk: Conversation, text: str, sign: float, distance_m: float | None = None) -> Answer:
    """Enlarge or reduce the last shift, else the distance to the vehicle of the last command, else along our way.

    Without a distance it is a bit: no more than the last shift.
    """
    request = talk.state.request
    backs = request is not None and request.query.manoeuvre == "back"
    direction: ShiftDirection = "back" if backs else "ahead"
    if request is not None and request.shifts:
        direction = request.shifts[-1].direction
        distance_m = distance_m or min(request.shifts[-1].distance_m, BIT_M)
    elif request is not None and request.query.landmark == "referent":
        direction = "away"
    return shift_last(talk, text, Shift(direction if sign > 0 else _OPPOSITE[direction], distance_m or BIT_M))


def change_distance(talk: Conversation, text: str, distance_m: float) -> Answer:
    """Plan the last command with another distance: "make it 5"."""
    request = talk.state.request
    if request is None:
        return ask_again(talk, text)
    if offers_place(talk) and (answer := _leave_gap(talk, text, distance_m)):
        return answer
    role = request.query.distance_of or ("referent" if request.query.referent else "ego")
    partial = Query(text, distance_m=float(distance_m), distance_of=role)
    return talk.take(talk.state.with_request(merge_request(request, partial)))


def _leave_gap(talk: Conversation, text: str, distance_m: float) -> Answer | None:
    """Take the place on offer with a gap to its vehicle, or with its own if that is larger; None without one."""
    question, place = talk.state.question, place_in_talk(talk)
    vehicle = question.referent if question is not None else None
    if vehicle is None or place is None:
        return None
    gap_m = abs(gap_beyond_m(place.ego_m, place.heading_ego_rad, place.ego, vehicle.item))
    if gap_m < distance_m:
        return shift_last(talk, text, Shift("away", distance_m - gap_m))
    taken = confirm(talk, text)
    return replace(taken, reasons=(*taken.reasons, f"the gap to it is {gap_m:.1f} m: there is no room nearer to it"))


def scale_distance(talk: Conversation, text: str, factor: float) -> Answer:
    """Plan the last command with a multiple of its distance: "half that"."""
    request = talk.state.request
    if request is None or request.query.distance_m is None:
        return ask_again(talk, text)
    return change_distance(talk, text, factor * request.query.distance_m)
