"""Steps of a command: one query for each commanded action, in order, and for each event that is awaited before it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import cast

from grounding.language.replies import words_end
from grounding.language.semantics.discourse.command_frames import Discourse
from grounding.language.semantics.discourse.coreference import resolve_anaphor
from grounding.language.semantics.main_action import SIDE_CONNECTIVES, Intent, MainIntent
from grounding.query import Query, Side
from grounding.vocabulary import LANDMARK_KINDS, RELATIONS, Relation

# Actions that end where the ego stands, and actions that hold until their event.
_STANDING = ("park", "stop", "pull_over")
_HOLDING = ("wait", "give_way")
_OTHER_SIDE: dict[str | None, Side] = {"left": "right", "right": "left"}
# Actions that go on until their event: "follow it until it turns".
_GOING_ON = ("follow", "other")
# Actions that are about a vehicle: "follow it when it leaves".
_OF_VEHICLES = ("follow", "overtake", "drive_past", "approach", "avoid")
# Actions that a later step about the same vehicle contains: "drive up to the van and stop behind it".
_ON_THE_WAY = ("approach", "other")
# An intent, the intents that add arguments to it, and all intents -> its query.
QueryOf = Callable[[MainIntent, Sequence[Intent], Sequence[Intent]], Query]


def plan_steps(
    discourse: Discourse, commands: Sequence[Intent], main: MainIntent, query: Query, query_of: QueryOf
) -> tuple[tuple[Query, ...], int]:
    """Return the steps of a command in order, and the index of the main one.

    Args:
        discourse: everything that the text states.
        commands: commanded intents.
        main: the intent of the query.
        query: the query about the main intent, with the arguments of all others.
        query_of: builds the query of one intent.
    """
    ordered = [one for one in commands if one.frame.connective not in SIDE_CONNECTIVES]
    if not any(one.frame is main.intent.frame for one in ordered):
        ordered.append(main.intent)
    ordered.sort(key=lambda one: one.frame.start)
    faced = [i for i in range(1, len(ordered)) if ordered[i].frame.verb.startswith("facing")]
    for i in faced:  # "park facing the other way": we turn around first
        ordered[i - 1 : i + 1] = ordered[i], ordered[i - 1]
    steps = [(one.frame is main.intent.frame, _step(discourse, one, main, query_of)) for one in ordered]
    verbs = [one.frame.verb for one in ordered]
    steps = [
        pair if pair[0] else (False, _changed_back(pair[1], steps[i - 1][1], verbs[i]))
        for i, pair in enumerate(steps)
    ]
    for i in faced:  # its sides are those of now: "on the left, facing the other way"
        is_main, step = steps[i]
        steps[i] = is_main, replace(step, goal_side=_OTHER_SIDE.get(step.goal_side))
    crossed = [None, *(step.crossed for _, step in steps)]
    steps = [(is_main, step.beyond(before)) for before, (is_main, step) in zip(crossed, steps, strict=False)]
    follows = [one.frame.connective == "then" for one in ordered]
    steps = [
        pair
        for i, pair in enumerate(steps)
        if pair[0] or (follows[i] and _parks_after(pair[1], steps[:i])) or not _is_contained(pair[1], steps, i)
    ]
    if len(steps) == 1:
        steps = [(True, query)]
    awaited = [_await(discourse, one, ordered, query_of) for one in steps]
    flat = [pair for group in awaited for pair in group]
    return tuple(step for _, step in flat), next(i for i, (is_main, _) in enumerate(flat) if is_main)


def _step(discourse: Discourse, intent: Intent, main: MainIntent, query_of: QueryOf) -> Query:
    """Return the query of one intent alone."""
    if intent.frame is main.intent.frame:
        return query_of(main, [main.intent], [main.intent])
    if intent.action in _HOLDING and intent.target is None and intent.frame.event_subject is not None:
        awaited = resolve_anaphor(discourse, intent.frame.event_subject)  # "wait until the bus leaves, then ..."
        intent = replace(intent, target=awaited)
    target = intent.target if intent.target is not None and intent.target.kind in ("vehicle", "person") else None
    return query_of(MainIntent(intent, target, intent.anaphora), [intent], [intent])


def _changed_back(step: Query, before: Query, verb: str) -> Query:
    """Return a step that comes back after a change of lane as the change to the other side."""
    words, side = tuple(verb.split()), _OTHER_SIDE.get(before.direction)
    if before.action != "change_lane" or side is None or words_end("return", words, 0) < len(words):
        return step
    changed = Query(step.command, "change_lane", ("change_lane",), direction=side)
    return replace(changed, distance_m=step.distance_m, distance_of=step.distance_of)


def _is_contained(step: Query, steps: Sequence[tuple[bool, Query]], at: int) -> bool:
    """Return whether a step adds nothing to the steps beside it."""
    later = [other for _, other in steps[at + 1 :]]
    sides = step.direction not in (None, "straight") or step.goal_side or step.road_side == "opposite"
    bare = step.referent is None and not (step.secondary or sides or step.distance_m)
    if step.action == "avoid":  # "pull over behind it, but stay well back"
        return any(step.referent is None or _same_vehicle(step, other) for _, other in steps[:at])
    if step.action in _ON_THE_WAY and later:
        # The only other step has its distance too: "go 15 metres and stop".
        stop = replace(step, action="stop", actions=("stop",), distance_m=None, distance_of=None)
        measures = len(steps) == 2 and later[0] == stop
        through = step.landmark is None and step.referent is None and not sides
        through = through and all(one.relation == "into" for one in step.secondary)
        crosses = through and later[0].landmark == "secondary"  # what lies beyond is counted from there
        stops = len(steps) == 2 and steps[at + 1][0] and _stops_there(step, later[0])
        return bare or crosses or _same_vehicle(step, later[0]) or measures or stops
    if step.direction == "around" and step.referent is None and not step.secondary:  # "turn around and go back"
        kept = [*steps[:at], *((is_main, other) for is_main, other in steps[at + 1 :] if is_main)]
        return any(other.direction == "around" for _, other in kept)
    if at > 0 and _stops_there(steps[at - 1][1], step):
        return True
    said_in_full = bool(later) and later[0].action == step.action  # "find a place to park behind the van"
    return (
        bare
        and step.action in _STANDING
        and (said_in_full or any(other.action in _STANDING for _, other in steps[:at]))
    )


def _parks_after(step: Query, before: Sequence[tuple[bool, Query]]) -> bool:
    """Return whether a step parks after a stop at a vehicle: "drop me at the van, then park"."""
    parks = step.action in ("park", "pull_over") and step.referent is None
    return parks and any(one.action == "stop" and one.referent is not None for _, one in before)


def _stops_there(step: Query, following: Query) -> bool:
    """Return whether a step only ends where the one before leads: "drive up to the van and stop"."""
    leads = step.action == "approach" and (step.referent is not None or step.landmark == "secondary")
    return leads and following == Query(following.command, "stop", ("stop",))


def _same_vehicle(one: Query, other: Query) -> bool:
    """Return whether two steps are about the same vehicle, by their words."""
    if one.referent is None or other.referent is None:
        return False
    like = other.referent
    return replace(one.referent, anaphora=like.anaphora, definite=like.definite) == like


def _drive_to_wait(step: Query) -> list[tuple[bool, Query]]:
    """Return the stop at the landmark where a step waits for an event: "wait at the junction until it has passed"."""
    where = next((one for one in step.secondary if one.of == "goal" and one.noun in LANDMARK_KINDS), None)
    if step.trigger is None or where is None:
        return []
    relation = cast(Relation, where.relation)
    stop = Query(step.command, "stop", ("stop",), relation=relation, landmark="secondary", secondary=(where,))
    return [(False, stop)]


def _await(
    discourse: Discourse, pair: tuple[bool, Query], commands: Sequence[Intent], query_of: QueryOf
) -> list[tuple[bool, Query]]:
    """Return a step after the wait for its event, if it has one: "after the bus leaves, turn left"."""
    is_main, step = pair
    if step.action in _HOLDING:
        return [*_drive_to_wait(step), pair]
    if step.trigger is None:
        return [pair]
    intent = next((one for one in commands if one.frame.event == step.trigger), None)
    ends = intent is not None and intent.frame.event_connective == "until" and not intent.frame.negated
    if ends and step.action in _GOING_ON:
        return [pair]
    subject = intent.frame.event_subject if intent is not None else None
    awaited = resolve_anaphor(discourse, subject) if subject is not None else None
    if intent is None or awaited is None or awaited.kind not in ("vehicle", "person", "traffic"):
        return [pair]
    waiting = replace(intent, action="wait", target=awaited)
    wait = query_of(MainIntent(waiting, awaited), [waiting], [waiting])
    held = replace(
        wait,
        relation="none",
        secondary=tuple(one for one in wait.secondary if one.of != "goal"),
        direction=None,
        goal_side=None,
        road_side=None,
        distance_m=None,
        distance_of=None,
        count=None,
    )
    step = replace(step, trigger=None)
    if step.relation == "none" and step.action not in _OF_VEHICLES and _same_vehicle(step, held):
        step = _at_landmark(replace(step, referent=None, landmark=None))  # the vehicle is only awaited
    if intent.frame.event_connective == "so":  # "pull over so that the van can pass": it waits for nothing
        return [(is_main, step) if step.action in _STANDING else pair]
    if ends and step.action in _STANDING:
        return [(is_main, step), (False, held)]  # "stop at the crossing until they are over"
    return [(False, held), (is_main, step)]


def _at_landmark(step: Query) -> Query:
    """Return a step without a vehicle with the relation to the landmark where it is done, if it names one."""
    where = next((one for one in step.secondary if one.of == "goal" and one.relation in RELATIONS), None)
    return step if where is None else replace(step, relation=cast(Relation, where.relation), landmark="secondary")
