"""Action classification: the action of a command frame from its verb class and arguments."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from grounding.language.semantics.discourse.command_frames import ENTERABLE, CommandFrame
from grounding.language.semantics.discourse.verb_rules import LETTING
from grounding.language.syntax.noun_phrases import NounPhrase
from grounding.vocabulary import ACTIONS

_LANE_CHANGING = ("go", "drive", "move", "get", "pull", "take", "turn", "change_lane", "approach", "overtake")
_LOTS = ("driveway", "parking_lot", "entrance")
_CORNERS = ("corner", "roundabout")
# Heads of landmarks for a gap: "keep your distance".
_GAP_WORDS = ("distance", "space", "room", "gap", "berth", "wide berth", "clearance", "leeway")
_LANES = ("lane", "bus_lane", "bike_lane")
# Relations of a goal directly at a vehicle.
_BESIDE_TARGET = ("behind", "in_front_of", "next_to")
# Relations that do not place the goal relative to a vehicle.
_NO_GOAL_RELATION = ("in", "into", "along", "on", "with", "of", "for", "object")
# Verbs of horn and lights; their relation does not place the goal.
_SIGNAL_VERBS = ("honk", "flash", "beep", "toot", "hoot", "sound", "blow", "signal", "tap", "press", "use", "hit")


def classify_action(frame: CommandFrame) -> str | None:
    """Return the action of a frame, None if it is not about driving; normalise its relation and direction."""
    action = _classify_lane_change(frame)
    if action is None:
        classify = _classify_plain if frame.verb_class in ACTIONS else _LIGHT_VERBS.get(frame.verb_class, _no_action)
        action = classify(frame)
    if action in ("park", "pull_over") and frame.relation == "toward":
        frame.relation = "near"
    passing = action == "overtake" and frame.relation in ("near", "toward", "left_of", "right_of")
    awaited = action in ("give_way", "wait") and frame.target_is_object
    if action == "slow_down" and frame.moves_away:
        frame.relation = "none"
    if frame.relation in _NO_GOAL_RELATION or action == "avoid" or passing or awaited:
        frame.relation = "none"
    return action


def _no_action(frame: CommandFrame) -> None:
    """Classify a verb that is not about driving."""


def _classify_lane_change(frame: CommandFrame) -> str | None:
    """Return change_lane for verbs of motion with a lane, else None."""
    pulls_in = frame.verb_class == "park" and frame.verb.endswith(("in", "into", "in to"))
    if frame.lane or frame.has_landmark(*_LANES):
        if frame.verb_class not in _LANE_CHANGING and not pulls_in:
            return None
        side = (frame.lane or "").removeprefix("next_").removesuffix("_lane")
        if side in ("left", "right"):
            frame.direction = frame.direction or side
        return "change_lane"
    target = frame.target
    target_lanes = [word for word in target.qualifiers if word.endswith("_lane")] if target is not None else []
    moves_beside = frame.relation in _BESIDE_TARGET and (pulls_in or frame.verb_class in ("get", "move"))
    return "change_lane" if moves_beside and target_lanes and target_lanes != ["own_lane"] else None


# ---------------------------------------------------------------- verbs with an action of their own


def _classify_plain(frame: CommandFrame) -> str | None:
    """Classify a verb with an action of its own."""
    if frame.verb.split()[0] in _SIGNAL_VERBS:
        frame.relation = "none"
    return _ACTION_VERBS.get(frame.verb_class, _keep_class)(frame)


def _keep_class(frame: CommandFrame) -> str | None:
    """Return the verb class, which is the action."""
    return frame.verb_class


def _is_off_topic(thing: NounPhrase | None) -> bool:
    """Return whether a thing is a part or unknown to the lexicon, and thus not about driving."""
    return thing is not None and (thing.kind == "part" or not thing.in_lexicon)


def _classify_park(frame: CommandFrame) -> str:
    """Classify "park"; "pull into the parking lot" is a turn, "back into the van" does harm."""
    if frame.target_is_object and frame.verb.endswith("into") and not frame.has_spot:
        frame.manoeuvre = "push"
    pulls_in = frame.verb.startswith("pull") and frame.relation not in _BESIDE_TARGET
    return "turn" if pulls_in and frame.has_landmark(*_LOTS, "road") else "park"


def _classify_stop_or_pass(frame: CommandFrame) -> str | None:
    """Classify "stop" and "overtake"; "stop the music" and "pass the salt" are not driving commands."""
    if frame.verb.startswith("get off") and frame.has_landmark("entrance"):
        return "turn"
    return None if frame.target is None and _is_off_topic(frame.direct_object) else frame.verb_class


def _classify_turn(frame: CommandFrame) -> str | None:
    """Classify "turn"; around or back to a vehicle it is an overtake or an approach."""
    free = frame.direction in (None, "around") or frame.verb[:4] != "turn"
    if frame.goes_around and frame.target is not None and free:
        frame.direction = None if frame.direction == "around" else frame.direction
        return "overtake"  # "go left around the van"
    if "back" in frame.verb and frame.target is not None:
        frame.direction = None
        return "approach"
    thing = frame.direct_object
    elsewhere = thing is not None and thing.kind != "region" and thing.noun not in ENTERABLE
    # "Turn on the radio."
    off_topic = any(relation in ("on", "along") and _is_off_topic(one) for relation, one in frame.landmarks)
    return None if frame.direction is None and (elsewhere or off_topic) else "turn"


def _classify_slow_down(frame: CommandFrame) -> str | None:
    """Classify "slow down"; "drive slowly past the bus" is a drive past, "chill the wine" no driving command."""
    if frame.target is None and _is_off_topic(frame.direct_object):
        return None
    word = frame.verb.split()[0]
    if word in ("inch", "creep", "crawl") and frame.target is not None and frame.relation != "past":
        return "approach"
    drives = word in ("drive", "go", "pass", "continue", "proceed", "move", "inch", "creep", "crawl")
    if drives and frame.target is not None and (frame.goes_around or frame.relation == "past"):
        return "overtake" if frame.goes_around else "drive_past"
    return "slow_down"


def _classify_other(frame: CommandFrame) -> str | None:
    """Classify "continue" and "reverse" by their place: behind a vehicle, past it or next to it."""
    if frame.manoeuvre == "push" and frame.target is None and frame.direct_object is not None:
        return None  # "push the button"
    if frame.verb.endswith(" off") and _is_off_topic(frame.direct_object):
        return None  # "take off your coat"
    if frame.has_spot or (frame.refers_to_place and frame.verb.startswith(("reverse", "back"))):
        return "park"
    if frame.target is None:
        return "other"
    if frame.verb.startswith(("reverse", "back")):
        return "park" if frame.relation == "between" else "other" if frame.relation == "none" else "approach"
    beside = dict.fromkeys(("next_to", "in_front_of", "near"), "approach")
    return ({"behind": "follow", "past": "drive_past"} | beside).get(frame.relation, "other")


def _classify_follow(frame: CommandFrame) -> str | None:
    """Classify "follow"; "follow the road" is other, "follow me on the net" not a driving command."""
    if frame.target is None and frame.landmarks:
        if all(_is_off_topic(thing) for _, thing in frame.landmarks):
            return None
        if frame.direct_object is not None and frame.direct_object.kind == "region":
            return "other"
    return "follow"


def _classify_give_way(frame: CommandFrame) -> str | None:
    """Classify "give way"; "let" needs an object."""
    alone = frame.target is None and frame.direct_object is None and frame.event_subject is None
    return None if alone and frame.verb in LETTING else "give_way"


def _classify_avoid(frame: CommandFrame) -> str | None:
    """Classify "avoid" and "watch"; "watch the film" is not a driving command."""
    watches = frame.verb.startswith("watch") and frame.target is None
    return None if watches and _is_off_topic(frame.direct_object) else "avoid"


def _classify_merge(frame: CommandFrame) -> str | None:
    """Classify "merge"; "merge the two documents" is not a driving command."""
    return None if frame.target is None and _is_off_topic(frame.direct_object) else "change_lane"


_ACTION_VERBS: Mapping[str, Callable[[CommandFrame], str | None]] = {
    "park": _classify_park,
    "stop": _classify_stop_or_pass,
    "overtake": _classify_stop_or_pass,
    "turn": _classify_turn,
    "slow_down": _classify_slow_down,
    "other": _classify_other,
    "follow": _classify_follow,
    "give_way": _classify_give_way,
    "change_lane": _classify_merge,
    "avoid": _classify_avoid,
}


# ---------------------------------------------------------------- light verbs


def _classify_motion(frame: CommandFrame) -> str | None:
    """Classify go, drive, move, get and pull."""
    verb, relation = frame.verb_class, frame.relation
    sideways = verb in ("get", "move", "pull")
    solid = frame.target is not None or any(thing.kind in ("thing", "person") for _, thing in frame.landmarks)
    corner = frame.has_landmark(*_CORNERS) or any(thing.head == "block" for _, thing in frame.landmarks)
    if frame.goes_around and (solid or corner):
        frame.relation = "none"
        return "turn" if frame.target is None and corner else "overtake"
    steers = frame.target is None or relation not in (*_BESIDE_TARGET, "toward", "past")
    if frame.direction in ("left", "right") and steers:
        enters = any(where == "into" and thing.noun in ENTERABLE for where, thing in frame.landmarks)
        return "turn" if enters or verb in ("go", "drive") else "change_lane"
    if relation == "past":
        return "overtake" if verb == "get" else "drive_past"
    if relation == "same_as":
        manner = frame.target is not None and frame.target.kind == "person"  # "you drive like my grandmother"
        return None if manner else "change_lane" if sideways else "follow"
    if relation == "between" and sideways and verb != "get" and not frame.has_spot:
        return "change_lane"
    enters = any(where in ("into", "in") and thing.noun in _LOTS for where, thing in frame.landmarks)
    if enters and not frame.refers_to_place:
        return "turn"
    return _classify_motion_without_target(frame) if frame.target is None else _classify_motion_to_target(frame)


def _classify_motion_to_target(frame: CommandFrame) -> str | None:
    """Classify motion to a vehicle; "move the car" is not a driving command."""
    verb, relation = frame.verb_class, frame.relation
    if frame.target_is_object and relation == "none":
        return None
    if frame.moves_away:
        frame.relation = "none"
        return "avoid"
    if frame.has_spot:
        return "park"
    if verb == "pull" and relation != "in_front_of":
        return "stop"
    return "follow" if relation == "behind" and verb == "drive" else "approach"


def _classify_motion_without_target(frame: CommandFrame) -> str | None:
    """Classify motion to a thing or onward."""
    verb = frame.verb_class
    named = [relation for relation, _ in frame.landmarks if relation != "object"]
    if frame.has_spot:
        return "park"
    only_parts = bool(frame.landmarks) and all(thing.kind == "part" for _, thing in frame.landmarks)
    if (frame.direct_object is not None and not named) or only_parts:
        return None
    if verb == "pull" and frame.direction != "straight":
        return "pull_over" if frame.side or frame.direction else "stop" if named or frame.refers_to_place else None
    if frame.refers_to_place or any(relation not in _NO_GOAL_RELATION for relation in named):
        return "approach"
    specified = named or frame.distances or frame.direction or frame.side or frame.goal_qualifiers
    return "other" if specified or verb in ("go", "drive", "move") else None


def _classify_stay(frame: CommandFrame) -> str | None:
    """Classify stay, keep and hold."""
    between = frame.relation == "between" and frame.distances  # "keep 5 metres between us and the bus"
    gap = frame.distances and frame.target is not None and frame.relation in ("none", "toward")
    if frame.moves_away or between or gap or _leaves_room(frame):
        return "avoid"
    if frame.relation in ("behind", "same_as", "next_to", "near") and frame.target is not None:
        return "follow"
    word = frame.verb.split()[0]
    if word.startswith("hold") and any(relation not in _NO_GOAL_RELATION for relation, _ in frame.landmarks):
        return "stop"  # "hold at the line"
    held = frame.target if frame.target is None or frame.target.kind != "person" else None  # "hold the baby"
    if word.startswith(("hold", "be")) and not (frame.lane or held):
        return None
    steers = frame.lane or frame.side or frame.direction
    thing = frame.direct_object
    if word.startswith("keep") and not steers and len(frame.landmarks) == 1 and thing and thing.kind == "thing":
        return None  # "keep your promises"
    specified = steers or frame.landmarks or frame.target or frame.goal_qualifiers
    return "other" if specified else "wait" if word.startswith(("stay", "remain")) else None


def _leaves_room(frame: CommandFrame) -> bool:
    """Return whether a landmark is a gap: "keep your distance", "leave some room"."""
    return any(thing.head in _GAP_WORDS for _, thing in frame.landmarks)


def _classify_take(frame: CommandFrame) -> str | None:
    """Classify take, make, find and use by their object."""
    thing, word = frame.direct_object, frame.verb.split()[0]
    searches = word.startswith(("find", "look", "search")) and frame.has_landmark("parking_lot")
    if frame.has_spot or frame.refers_to_place or searches:
        return "park"
    if word.startswith("pick") and thing is not None and thing.kind == "person":
        return "stop"
    if frame.side == "opposite":
        return "pull_over"  # "use the other side of the road"
    frame.direction, frame.side = frame.direction or frame.side, None
    entered = thing is not None and thing.noun in ENTERABLE and (thing.noun == "turn" or word not in ("make", "do"))
    return "turn" if frame.direction or entered else None


def _classify_bring(frame: CommandFrame) -> str | None:
    """Classify bring: "bring me to the van", "take us home"."""
    named = any(relation != "object" for relation, _ in frame.landmarks)
    if frame.goes_around and frame.target is None and frame.has_landmark(*_CORNERS):
        return "turn"  # "take us round the corner"
    if frame.relation == "past":
        return "drive_past"
    to_target = frame.target is not None and not frame.target_is_object
    return "approach" if named or frame.refers_to_place or "home" in frame.verb or to_target else None


def _classify_leave(frame: CommandFrame) -> str | None:
    """Classify leave: "leave some room", "leave the parking lot"."""
    if _leaves_room(frame) or frame.distances:
        return "avoid"
    if frame.has_landmark(*_LANES):
        return "change_lane"
    return "other" if frame.has_spot or frame.has_landmark("road", "parking_lot", "lane", "driveway") else None


def _classify_give(frame: CommandFrame) -> str | None:
    """Classify give: "give it a honk", "give the bus room to merge"."""
    if any(thing.head in _SIGNAL_VERBS for _, thing in frame.landmarks):
        return "other"  # "give it a honk"
    return "give_way" if frame.event else "avoid" if _leaves_room(frame) else None


_LIGHT_VERBS: Mapping[str, Callable[[CommandFrame], str | None]] = {
    **dict.fromkeys(("go", "drive", "move", "get", "pull"), _classify_motion),
    "stay": _classify_stay,
    "take": _classify_take,
    "bring": _classify_bring,
    "leave": _classify_leave,
    "give": _classify_give,
}
