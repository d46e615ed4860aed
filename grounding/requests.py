"""Requests: the commanded steps of a reading, and what a conversation has settled about them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

from appocc.checks import FloatArray
from grounding.goal.shift import HeldPose, Shift
from grounding.language import Reading
from grounding.query import Query, Referent
from grounding.referent.resolver import Candidate
from grounding.referent.scene import SceneModel
from grounding.road.lane_model import LANE_M
from grounding.scene_object import SceneObject
from grounding.vocabulary import PASSING_ACTIONS

# Actions of a stop.
STOPS = ("park", "stop", "pull_over", "approach")
# Actions that hold us up for somebody or something.
HOLDING = ("wait", "give_way")
# Nouns of where a turn leads round.
_CORNERS = ("corner", "street_corner", "bend", "curve")


@dataclass(frozen=True, eq=False)
class Sighting:
    """Where a vehicle was when a command was given: place (2,) and heading in the world, and whether it was ahead."""

    world_m: FloatArray
    heading_rad: float
    ahead: bool

    @classmethod
    def of(cls, item: SceneObject, scene: SceneModel) -> Sighting:
        """Return the sighting of an object of a scene."""
        ahead = bool(item.centre_m[0] > scene.ego.centre_m)
        return cls(scene.world_xy(item.centre_m), scene.world_heading(item.yaw_rad), ahead)


@dataclass(frozen=True, eq=False, kw_only=True)
class Request:
    """One commanded step and what a conversation has settled about it.

    Attributes:
        reading: reading whose query is this step.
        chosen: the referent, if it is settled.
        ruled_out: ids of objects that are not meant.
        shifts: changes of the place, in order; with `held`, since then.
        held: place that was agreed to, or that of a step without a vehicle while driving, which is kept in the world;
            None if it is planned from the query.
        sighting: the vehicle when the step was asked for; None before the scene changes.
    """

    reading: Reading
    chosen: Candidate | None = None
    ruled_out: frozenset[str] = frozenset()
    shifts: tuple[Shift, ...] = ()
    held: HeldPose | None = None
    sighting: Sighting | None = None

    @property
    def query(self) -> Query:
        """The typed query of the step."""
        return self.reading.query


def requests_of(reading: Reading) -> tuple[Request, ...]:
    """Return the steps of a reading in order."""
    waits = (
        _waiting_there(before, step) for before, step in zip([None, *reading.steps], reading.steps, strict=False)
    )
    return join_drives(tuple(Request(reading=reading.with_query(step)) for step in waits))


def _waiting_there(before: Query | None, step: Query) -> Query:
    """Return the wait after the stop at its landmark as one where we stand: who is awaited is no place."""
    if before is None or step.action != "wait" or step.trigger is None:
        return step
    same = before.landmark == "secondary" and {*before.secondary} & {*step.secondary}
    return replace(step, relation="none", landmark="referent" if step.referent else None) if same else step


def join_drives(requests: Sequence[Request]) -> tuple[Request, ...]:
    """Return steps in which driving on to a stop is no step of its own: "go 30 metres and park on the right".

    A stop round the corner, after a turn, is a stop after it.
    """
    joined = list[Request]()
    for request in requests:
        stop = _after_drive(joined[-1].query, request.query) if joined else None
        if stop is not None:
            request = replace(request, reading=request.reading.with_query(stop))
            joined.pop()
        elif joined and _is_round_corner(joined[-1].query, request.query):
            request = replace(request, reading=request.reading.with_query(_after_turn(request.query)))
        joined.append(request)
    return tuple(joined)


def _is_round_corner(turn: Query, stop: Query) -> bool:
    """Return whether a stop is just round the corner at which we have turned."""
    turns = turn.action == "turn" and turn.direction in ("left", "right")
    at_corner = stop.landmark == "secondary" and stop.referent is None and stop.relation in ("near", "past")
    return turns and at_corner and all(one.noun in _CORNERS and not one.qualifiers for one in stop.secondary)


def _after_turn(stop: Query) -> Query:
    """Return a stop round the corner as one after the turn: "on the left" is a side then."""
    side = stop.direction if stop.direction in ("left", "right") else stop.goal_side
    return replace(stop, relation="none", landmark=None, secondary=(), direction=None, goal_side=side)


def _after_drive(drive: Query, stop: Query) -> Query | None:
    """Return the query of a stop at the end of a drive that has no other end; None for other steps."""
    if drive.action == "overtake" and stop.action in STOPS and stop.relation == "in_front_of":
        return stop if _is_same(drive.referent, stop.referent) else None  # the place says that we have passed it
    lanes_only = all(one.noun == "lane" and one.relation in ("in", "on") for one in drive.secondary)
    anywhere = drive.relation == "none" and lanes_only and not (drive.referent or drive.trigger or drive.unresolved)
    if anywhere and drive.secondary and drive.action == "other" and stop.relation != "none" and not stop.trigger:
        return stop if drive.distance_m is None and drive.direction is None else None  # "stay in our lane and ..."
    anywhere = anywhere and not drive.secondary
    onward = drive.action == "other" and drive.direction in (None, "straight") and drive.manoeuvre in (None, "onward")
    if not (anywhere and onward and stop.action in STOPS) or stop.trigger or stop.manoeuvre:
        return None
    if drive.distance_m is None:  # "keep straight for now", "then stop in 20 metres": from where we are
        return stop if stop.distance_of == "ego" else None
    if stop.relation != "none" or stop.distance_m is not None or stop.referent or stop.secondary or stop.unresolved:
        return None
    return replace(stop, distance_m=drive.distance_m, distance_of="ego")


def _is_same(named: Referent | None, meant: Referent | None) -> bool:
    """Return whether two steps describe their vehicle in the same words."""
    if named is None or meant is None:
        return False
    return named == replace(meant, head=named.head, anaphora=named.anaphora)


def after_turns(requests: Sequence[Request]) -> Sequence[Request]:
    """Return steps in which "after the turn" is the place where the step before it ends."""
    placed = list(requests)
    for i, (step, following) in enumerate(pairwise(requests), start=1):
        query = following.query
        turn = next((one for one in query.secondary if one.of == "goal" and one.noun == "turn"), None)
        if step.query.action != "turn" or turn is None or query.landmark != "secondary":
            continue
        others = tuple(one for one in query.secondary if one is not turn)
        query = replace(query, relation="none", landmark=None, secondary=others)
        placed[i] = replace(following, reading=following.reading.with_query(query))
    return placed


def after_passing(requests: Sequence[Request]) -> Sequence[Request]:
    """Return steps in which the place past a vehicle that the step before passes is where that step ends."""
    placed = list(requests)
    for i, (step, following) in enumerate(pairwise(requests), start=1):
        query, passed = following.query, step.query
        passes = passed.action in PASSING_ACTIONS and query.relation == "past" and query.action in STOPS
        if passes and _is_same(passed.referent, query.referent):
            query = replace(query, relation="none", landmark=None, referent=None)
            placed[i] = replace(following, reading=following.reading.with_query(query), chosen=None)
    return placed


def into_its_lane(request: Request, before: Candidate | None, scene: SceneModel) -> Request:
    """Return a change to a lane of no side as one to the side of the vehicle of the step before: "into its lane"."""
    query, road = request.query, scene.road
    lanes_only = bool(query.secondary) and all(one.noun == "lane" and not one.qualifiers for one in query.secondary)
    unplaced = query.action == "change_lane" and query.direction is None and query.referent is None
    if not (unplaced and lanes_only) or before is None or road is None:
        return request
    aside_m = float(road.ego_lane.project(before.item.centre_m)[1])
    if abs(aside_m) < LANE_M / 2:
        return request
    side = replace(query, direction="left" if aside_m > 0 else "right", relation="none", landmark=None, secondary=())
    return replace(request, reading=request.reading.with_query(side))


def without_referent(request: Request, reasons: Sequence[str]) -> Request:
    """Return a step without its vehicle, which only told why: "slow down, there's a bus"; noted with reasons."""
    reading, query = request.reading, replace(request.query, referent=None, landmark=None)
    told = replace(reading, notes=(*reading.notes, *reasons))
    return replace(request, reading=told.with_query(query))
