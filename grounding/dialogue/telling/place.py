"""Answers about the place at the goal: how far it is from a vehicle and from the kerb, and what comes after it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from grounding.answer import Answer
from grounding.dialogue.conversation import Conversation
from grounding.dialogue.telling.measures import describe_one
from grounding.dialogue.telling.phrases import describe_goal
from grounding.dialogue.telling.reports import NOT_KNOWN, aside, tell_goal, unknown
from grounding.dialogue.telling.things import find_things
from grounding.goal.ego_lane import is_standing
from grounding.goal.planner import Target
from grounding.language import Reading, WordCategory
from grounding.language.questions import Question
from grounding.query import Query
from grounding.referent.scene import SceneModel
from grounding.requests import Request
from grounding.road.free_space import gap_m
from grounding.scene_object import SceneObject


def tell_walk(talk: Conversation, text: str, question: Question) -> Answer:
    """Tell how far the goal is from a vehicle; where somebody walks to besides is not known."""
    place, items = place_of(talk), things_at(talk, question)
    if place is None or not items:
        return unknown(talk, text, "how far there is to walk, and where to")
    told = [_describe_from(place, one, talk.scene) for one in items]
    return aside(talk, text, *told, f"{NOT_KNOWN}: where you walk to from there")


def is_at_it(talk: Conversation, words: str) -> bool:
    """Return whether words are a relation to the vehicle of the plan, named or left out: "after", "behind it"."""
    first, *others = talk.read(words).tokens if words else (None,)
    relations = (WordCategory.RELATION, WordCategory.WHERE, WordCategory.SUB)  # "after" may begin a clause
    related = first is not None and first.category in relations
    return related and all(one.category in (WordCategory.PRONOUN, WordCategory.THAT) for one in others)


def tell_at_place(talk: Conversation, text: str, question: Question) -> Answer | None:
    """Tell how far the goal is from the kerb or a vehicle that are named; None without a goal or one of them."""
    place = place_of(talk)
    if place is None:
        return None
    if "kerb" in question.kinds:
        return aside(talk, text, describe_kerb(place, talk.scene))
    words = "" if is_at_it(talk, question.words) else question.words
    items = things_at(talk, replace(question, words=words))
    return aside(talk, text, *(_describe_from(place, one, talk.scene) for one in items)) if items else None


def tell_next(talk: Conversation, text: str, question: Question) -> Answer | None:
    """Tell the steps of the plan, and that nothing comes after the last one."""
    goal = talk.state.goal
    if goal is None or talk.state.question is not None:
        return tell_goal(talk, text) if talk.state.question or not question.words else None
    return aside(talk, text, *describe_goal(goal), "after that nothing is planned")


def place_of(talk: Conversation) -> Target | None:
    """Return the goal in force, else the place that is offered; None without one."""
    about = talk.state.goal or talk.state.question
    return None if about is None else about.target or about.plan.nearest


def standing_place(talk: Conversation) -> Target | None:
    """Return the goal or the place that is offered, else where we are known to stand now; None without one."""
    road = talk.scene.road
    if (place := place_of(talk)) is not None or road is None or not is_standing(road):
        return place
    return talk.answer_steps([Request(reading=Reading(Query("", "stop", ("stop",))))]).target


def things_at(talk: Conversation, question: Question) -> list[SceneObject]:
    """Return the vehicles that a question names, else that of the goal."""
    if question.words and (named := find_things(talk, question).items):
        return named
    chosen = talk.state.plan[-1].chosen if talk.state.plan else None
    goal = talk.state.goal
    referent = chosen or (goal.referent if goal is not None else None)
    return [referent.item] if referent is not None else []


def _describe_from(place: Target, item: SceneObject, scene: SceneModel) -> str:
    between_m = max(float(gap_m(item, place.ego, place.ego_m, np.asarray(place.heading_ego_rad))), 0.0)
    return f"the place is {between_m:.1f} m from {describe_one(item, scene)}"


def kerb_gap(place: Target, scene: SceneModel) -> tuple[float, str] | None:
    """Return how far the side of the ego is from the nearer edge of the road, and on which side; None if unknown."""
    if scene.road is None:
        return None
    turned = place.heading_ego_rad + np.array([np.pi / 2, -np.pi / 2])
    edges_m = scene.road.edge_distance_m(np.array([place.cell] * 2), turned) - place.ego.width_m / 2
    return max(float(edges_m.min()), 0.0), ("left", "right")[int(np.argmin(edges_m))]


def describe_kerb(place: Target, scene: SceneModel) -> str:
    """Tell how far the side of the ego is from the nearer kerb."""
    edge = kerb_gap(place, scene)
    if edge is None:
        return f"{NOT_KNOWN}: where the kerb is"
    return f"the place is {edge[0]:.1f} m from the kerb on our {edge[1]}"
