"""Answers about others on our way: who comes towards us, and who holds us up."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np

from appocc.motion_state import MOVING_MPS
from grounding.answer import Answer
from grounding.dialogue.conversation import Conversation
from grounding.dialogue.telling.measures import (
    approaches,
    describe_change,
    describe_facing,
    describe_one,
    find_in_lane,
)
from grounding.dialogue.telling.phrases import describe_goal
from grounding.dialogue.telling.reports import NOT_KNOWN, aside, tell_reasons, unknown
from grounding.dialogue.telling.things import Things, describe_any, find_things
from grounding.goal.conflicts import explain_conflicts
from grounding.language.questions import Question
from grounding.query import Referent
from grounding.referent.resolver import MAX_CANDIDATES, Candidate, find_all
from grounding.requests import requests_of
from grounding.road.lane_model import LANE_M
from grounding.scene_object import SceneObject

# What holds of every place that is found, and of a way that nobody comes into.
_KEPT = "the place is on the road, and clear of all vehicles that are seen"
_CLEAR = "nobody who is seen drives into our way there, at the speeds of now"
UNSURE = f"{NOT_KNOWN}: signs, rules of parking, and what others will do"
# Whether somebody comes nearer.
_NEARER = re.compile(r"\b(?:closer|nearer|towards? (?:us|me)|at us|our way)\b")
# Words of vehicles that come from behind.
_FROM_BEHIND = re.compile(r"\bfrom (?:behind|the back|the rear)(?: us| me)?\b")
# Words of the lane that a plan changes to.
_IN_IT = re.compile(r"\bin (?:it|there|that lane|that one)\b|\bthere$")
# Words of vehicles that come towards us.
_TOWARDS_US = re.compile(r"\btowards? (?:us|me)\b|\b(?:at us|our way|oncoming|the other way)\b")
# What stands for a vehicle before its place: "anything behind us".
_NAMELESS = re.compile(r"^(?:an? |any |up )?(?=from |behind |on |ahead |in )")
# What leads in the manoeuvre that is asked about.
_TO = re.compile(r"^.*?\bto ")
# Who is in the lane beside ours this far behind and ahead of us hinders us there.
_LANE_BACK_M, _LANE_AHEAD_M, _MOST_TOLD = 30.0, 20.0, 3
# A vehicle turns off at a greater yaw rate.
_TURNING_RADPS = 0.12
# Who is beside us is this near along our lane.
_LEVEL_M = 6.0
_LANES, _SIDES = ("left_lane", "right_lane"), ("left_side", "right_side")


def tell_coming(talk: Conversation, text: str, question: Question) -> Answer:
    """Tell whether anyone drives towards us, and who; who is to pass first is the nearest of them."""
    points = " in it" if re.search(r"\bthere\b", text.lower()) and "there" not in question.words.split() else ""
    words = _FROM_BEHIND.sub("behind us", _in_lane(talk, f"{question.words}{points}")).removesuffix(" in it")
    reading = describe_any(talk, _NAMELESS.sub("vehicle ", words)) or describe_any(talk, words)
    named = reading.query.referent if reading is not None else None
    here = find_all(named or Referent("vehicle", "vehicle"), talk.scene)
    faces = _TOWARDS_US.search(text.lower()) is not None and not _FROM_BEHIND.search(text.lower())
    back_m = talk.scene.ego.centre_m
    coming = [one for one in here if approaches(one) and not (faces and one.centre_m[0] < back_m)][:MAX_CANDIDATES]
    told = [describe_one(one, talk.scene) for one in coming]
    if _FROM_BEHIND.search(text.lower()) or "behind" in words:
        beside = [one for one in _find_beside_us(talk, words) if one not in coming]
        told += [f"beside us: {describe_one(one, talk.scene)}" for one in beside]
        coming = [*beside, *coming]
    talk.list_items(coming)  # "wait till it's past"
    if coming and talk.state.goal is None and talk.state.question is None:
        focus = Candidate(coming[0], {}, 1.0), Referent(coming[0].class_name, coming[0].common_name)
        talk.state = replace(talk.state, focus=focus, topic=None)
    where = "nothing that is seen there" if words else "nothing that is seen"
    yes = [] if "description" in question.kinds else ["yes"]  # "what colour is the car coming towards us?"
    return aside(talk, text, *([*yes, *told] if told else [f"no: {where} comes towards us"]))


def _find_beside_us(talk: Conversation, words: str) -> list[SceneObject]:
    """Return the vehicles that drive our way in the lanes beside ours, on the side that is named."""
    table = talk.scene.table
    named = [sign for side, sign in (("left", 1.0), ("right", -1.0)) if side in words.split()]
    near = (np.abs(table.along_m) < _LEVEL_M) & (np.abs(np.abs(table.lateral_m) - LANE_M) < LANE_M / 2)
    near &= (np.nan_to_num(table.speed_mps) > MOVING_MPS) & (np.cos(table.relative_heading_rad) > 0)
    near &= np.isin(np.sign(table.lateral_m), named or [1.0, -1.0])
    return [table.items[int(row)] for row in np.flatnonzero(near)]


def _in_lane(talk: Conversation, words: str) -> str:
    """Return words in which "in it" is the lane to which the plan in force changes."""
    goal = talk.state.goal
    side = goal.query.direction if goal is not None and goal.query.action == "change_lane" else None
    return words if side is None else _IN_IT.sub(f"in the {side} lane", words)


def tell_lane(talk: Conversation, text: str, question: Question) -> Answer:
    """Tell whether the lanes beside ours are free: the one on the side that a question names, or both."""
    said = {str(token.value)[: -len("_lane")] for token in talk.read(text).tokens if token.value in _LANES}
    said |= {str(token.value)[: -len("_side")] for token in talk.read(text).tokens if token.value in _SIDES}
    told = [_describe_lane(talk, side) for side in ("left", "right") if side in said or not said]
    return aside(talk, text, *told)


def tell_safe(talk: Conversation, text: str, question: Question) -> Answer:
    """Tell who is in the way of the manoeuvre that a question names, else of the plan in force."""
    asked = talk.readings(_TO.sub("", question.words), talk.antecedent, alone=False)[0] if question.words else None
    named = asked is not None and asked.query.action is not None and not asked.doubt
    answer = talk.answer_steps(requests_of(asked)) if asked is not None and named else talk.state.goal
    told: list[str] = []
    if answer is not None and answer.target is None and named:
        told = list(answer.reasons)
    elif answer is not None and answer.target is not None:
        first = answer.plan.passes_first
        told = [*([] if named else [_KEPT]), *(explain_conflicts([first], talk.scene) if first else [_CLEAR])]
    return aside(talk, text, *told, UNSURE)


def _describe_lane(talk: Conversation, side: str) -> str:
    """Tell who is in the lane on one side of ours, near enough to hinder us."""
    table, sign = talk.scene.table, 1 if side == "left" else -1
    there = np.abs(table.lateral_m - sign * LANE_M) < LANE_M / 2
    rows = np.flatnonzero(there & (table.along_m > -_LANE_BACK_M) & (table.along_m < _LANE_AHEAD_M))
    if not len(rows):
        return f"on the {side}: free, as far as is seen"
    nearest = rows[np.argsort(np.abs(table.along_m[rows]))][:_MOST_TOLD]
    return f"on the {side}: not free: {'; '.join(describe_one(table.items[int(row)], talk.scene) for row in nearest)}"


def tell_waiting(talk: Conversation, text: str, question: Question) -> Answer:
    """Tell what holds us up: who is ahead in our lane, and what the plan waits for."""
    if (
        question.kind == "waiting"
        and "which" not in question.kinds
        and (told_of := _tell_in_way(talk, text, question))
    ):
        return told_of
    asked = talk.state.question
    if asked is not None and asked.plan.question and not question.words:
        return tell_reasons(talk, text)  # "what is in the way?" of a place that is full
    in_lane, goal = find_in_lane(talk.scene), talk.state.goal
    ahead = in_lane[0] if in_lane else None
    here = "nothing is seen ahead of us in our lane"
    told = [here if ahead is None else f"ahead of us: {describe_one(ahead, talk.scene)}"]
    waits = goal is not None and any(one.pace == "standing" for one in (goal, *goal.steps))
    if goal is None:
        told.append("no command is set")
    elif waits:
        told += describe_goal(goal)
    elif ahead is None:
        told.append("nothing that is seen holds us up")
    return aside(talk, text, *told)


def _tell_in_way(talk: Conversation, text: str, question: Question) -> Answer | None:
    """Tell whether the vehicles that a question names are ahead in our lane; None if it names none."""
    things = find_things(talk, replace(question, of_us=True))
    held = find_in_lane(talk.scene)
    told = [
        f"yes: {describe_one(one, talk.scene)}"
        if one in held
        else f"no: {describe_one(one, talk.scene)}, not ahead in our lane"
        for one in things.items
    ]
    return aside(talk, text, *(told or things.reasons)) if told or things.reasons else None


def tell_pace(talk: Conversation, text: str, question: Question) -> Answer | None:
    """Tell a vehicle's speed, and whether it changes where that is known."""
    things = find_things(talk, question)
    if not things.found:
        whose = "our own speed" if question.of_us else "which vehicle is meant"
        return aside(talk, text, *things.reasons) if things.reasons else unknown(talk, text, whose)
    if _NEARER.search(text.lower()):
        told = [f"{'yes' if approaches(one) else 'no'}: {describe_one(one, talk.scene)}" for one in things.items]
        return aside(talk, text, *told)
    told = [f"{describe_one(one, talk.scene)}{describe_change(one)}" for one in things.items]
    open_ = any(one.acceleration_mps2 is None for one in things.items)
    return aside(talk, text, *told, *([f"{NOT_KNOWN}: whether it gets faster or slower"] if open_ else []))


def tell_turning(talk: Conversation, text: str, things: Things) -> Answer:
    """Tell whether vehicles turn off, by their yaw rates."""
    told = [f"{_turns(one)}{describe_facing(one, talk.scene)}" for one in things.items]
    open_ = any(one.is_moving and one.yaw_rate_radps is None for one in things.items)
    unsure = [f"{NOT_KNOWN}: whether it is turning"] if open_ else []
    return aside(talk, text, *(told or things.reasons), *unsure)


def _turns(item: SceneObject) -> str:
    """Return whether an object turns, before it is told; '' where that is not known."""
    if not item.is_moving:
        return "no: " if item.is_standing else ""
    if item.yaw_rate_radps is None:
        return ""
    return "yes: " if abs(item.yaw_rate_radps) > _TURNING_RADPS else "no: "
