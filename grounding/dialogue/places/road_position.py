"""Where across the road a turn wants us: "not in the road", "on our side", "the other side", "in our lane"."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace

from grounding.answer import Answer
from grounding.dialogue.clauses import clauses_of, is_phrase
from grounding.dialogue.conversation import Conversation
from grounding.dialogue.fragments import begins_with_place, has_verb, only_named
from grounding.dialogue.places.somewhere import after_someplace
from grounding.dialogue.telling.reports import inform
from grounding.goal.limits import stands_at_edge
from grounding.goal.planner import Target
from grounding.query import Query
from grounding.referent.scene import SceneModel
from grounding.requests import STOPS, Request
from grounding.road.lane_model import LANE_M
from grounding.vocabulary import Relation

# Positions across the road, by the kinds of their phrases, in words.
_POSITIONS: Mapping[str, str] = {
    "atedge": "at the edge of the road",
    "ourside": "on our side of the road",
    "otherside": "on the other side of the road",
    "ourlane": "in our lane",
}
# Relations of a place at the side of a vehicle, and those in its line.
_BESIDE = ("next_to", "near", "at", "toward", "left_of", "right_of")
_IN_LINE: tuple[Relation, ...] = ("behind", "in_front_of")
# Places short of and beyond a vehicle in our own lane, by those in its line.
_IN_OUR_LANE: Mapping[str, Relation] = {"behind": "before", "in_front_of": "past"}
# Qualifiers of the side on which a vehicle stands.
_OF_SIDES = ("own_side", "opposite_side")


def answer_road_position(talk: Conversation, text: str, answer_rest: Callable[[str], Answer]) -> Answer | None:
    """Answer a turn that says where across the road we are to stand; None for other turns.

    Where there is no such place, that is told and the goal stays.

    Args:
        talk: the conversation.
        text: the turn.
        answer_rest: answers the other words of the turn, which may name another place.
    """
    state, request = talk.state, talk.state.request
    if request is None or state.lists or request.query.pace is not None:
        return None
    clauses = clauses_of(talk, text)
    kinds = [next((kind for kind in _POSITIONS if is_phrase(kind, words)), "") for words in clauses]
    position = next(filter(None, kinds), "")
    if not position or (position == "ourlane" and _changes_lane(request)):
        return None
    others = (after_someplace(words) for words, kind in zip(clauses, kinds, strict=True) if not kind)
    rest = [" ".join(words) for words in others if words]
    if position == "otherside" and _is_across(request.query) and not rest:
        position = "ourside"  # the other one than that of the goal
    if any(_asks_for_more(talk, one) for one in rest):
        return _with_rest(talk, position, request, answer_rest, ", ".join(rest))
    return _move(talk, text, position, request)


def _changes_lane(request: Request) -> bool:
    return request.query.action == "change_lane"


def _asks_for_more(talk: Conversation, rest: str) -> bool:
    """Return whether the other words of a turn ask for something: not "wrong side, I meant our side"."""
    reading = talk.read(rest)
    return bool(has_verb(reading) or begins_with_place(rest, talk.readings) or only_named(reading.tokens))


def _with_rest(
    talk: Conversation, position: str, request: Request, answer_rest: Callable[[str], Answer], rest: str
) -> Answer | None:
    """Answer the other words of a turn at a position across the road; None where that is no place there."""
    before = talk.state
    wished = next(_placed(position, request))
    talk.state = replace(before, asked=before.with_request(wished), question=None)
    answer = answer_rest(rest)
    if answer.status == "ok" and answer.target is not None and talk.state.asked != before.with_request(wished):
        steps = tuple(next(_placed(position, step)) for step in talk.state.plan)
        placed = talk.answer_steps(steps)
        if placed.status == "ok" and (placed.target is None or _stands(position, placed.target, talk.scene)):
            return talk.settle(steps, placed)
        if position == "atedge":  # "not in the road, somewhere after it"
            talk.state = before
            return _tell_no_place(talk, rest, position)
    talk.state = before
    return None


def _move(talk: Conversation, text: str, position: str, request: Request) -> Answer:
    """Move the place that was asked for last across the road."""
    state, goal = talk.state, talk.state.goal
    settled = goal is not None and state.question is None and goal.query.relation == request.query.relation
    # A stop at no vehicle is in our lane, and at the edge of a narrow road at best by chance.
    settled = settled and not (position == "atedge" and request.query.action == "stop" and not request.query.landmark)
    if settled and goal is not None and goal.target is not None and _stands(position, goal.target, talk.scene):
        return inform(talk, text, f"the goal stays as it is: it is {_POSITIONS[position]}")
    for changed in _placed(position, request):
        steps = state.with_request(_said(changed, text))
        answer = talk.answer_steps(steps, state.at)
        if answer.status == "ok" and (answer.target is None or _stands(position, answer.target, talk.scene)):
            return talk.settle(steps, answer)
    return _tell_no_place(talk, text, position)


def _said(request: Request, text: str) -> Request:
    return replace(request, reading=request.reading.with_query(replace(request.query, command=text)))


def _tell_no_place(talk: Conversation, text: str, position: str) -> Answer:
    kept = ("the goal stays as it is",) if talk.state.goal is not None else ()
    answer = inform(talk, text, f"there is no free place {_POSITIONS[position]} there: say where else", *kept)
    return answer if kept else replace(answer, status="not_found")


def _stands(position: str, target: Target, scene: SceneModel) -> bool:
    """Return whether a place is at a position across the road."""
    road = scene.road
    if road is None:
        return True
    if position == "atedge":
        return stands_at_edge(road, target.cell, target.heading_ego_rad)
    lateral_m = float(road.ego_lane.project(target.ego_m)[1])
    if position == "ourlane":
        return abs(lateral_m) < LANE_M / 2
    return (road.traffic_side * lateral_m < LANE_M / 2) == (position == "ourside")


def _is_across(query: Query) -> bool:
    return query.relation == "opposite" or query.road_side == "opposite"


def _placed(position: str, request: Request) -> Iterator[Request]:
    """Yield a step with its place at a position across the road, what is nearest to the command first."""
    query = _without_sides(request.query)
    options = {"atedge": _at_edge, "ourside": _on_our_side, "otherside": _across, "ourlane": _in_our_lane}
    for wished in options[position](query):
        changed = request.reading.with_query(wished)
        yield replace(request, reading=changed, shifts=(), held=None)


def _without_sides(query: Query) -> Query:
    """Return a query whose place has no side; that of the vehicle is known."""
    named = query.referent
    if named is not None:
        named = replace(named, qualifiers=tuple(one for one in named.qualifiers if one not in _OF_SIDES))
    relation = "next_to" if query.relation == "opposite" else query.relation
    return replace(query, referent=named, relation=relation, goal_side=None, road_side=None)


def _at_edge(query: Query) -> Iterator[Query]:
    if query.action in ("stop", "approach"):
        query = replace(query, action="pull_over", actions=("pull_over",))
    alone = query.referent is None and query.landmark is None
    yield replace(query, road_side="kerb") if alone else query
    for relation in _IN_LINE if query.relation in _BESIDE else ():
        yield replace(query, relation=relation, distance_m=None, distance_of=None)


def _on_our_side(query: Query) -> Iterator[Query]:
    alone = query.referent is None and query.landmark is None
    yield replace(query, road_side="kerb") if alone and query.action in STOPS else query


def _across(query: Query) -> Iterator[Query]:
    if query.referent is None:
        yield replace(query, road_side="opposite")
    else:
        yield replace(query, relation="opposite", landmark="referent", distance_m=None, distance_of=None)


def _in_our_lane(query: Query) -> Iterator[Query]:
    if query.action == "overtake":
        yield replace(query, action="drive_past", actions=("drive_past",), relation="past")
    elif query.action in STOPS:
        query = replace(query, action="stop", actions=("stop",))
        yield query
        if (relation := _IN_OUR_LANE.get(query.relation)) is not None:
            yield replace(query, relation=relation)
    else:
        yield query
