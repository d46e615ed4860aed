"""What a verb commands together with what stands beside it."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from grounding.language.command_frames import Deed
from grounding.language.noun_phrases import Phrase
from grounding.language.word_categories import ACTIONS

_LANE_CHANGING = ("go", "drive", "move", "get", "pull", "take", "turn", "change_lane", "approach", "overtake")
# What one turns into or takes: "turn into the driveway", "take the exit".
_ENTERED = ("driveway", "parking_lot", "entrance", "road", "turn", "exit", "corner", "intersection", "roundabout")
_LOTS = ("driveway", "parking_lot", "entrance")
_ROUND = ("corner", "roundabout")
_KEPT_FREE = ("distance", "space", "room", "gap", "berth", "wide berth", "clearance", "leeway")
_LANES = ("lane", "bus_lane", "bike_lane")
_BESIDE = ("behind", "in_front_of", "next_to")
# Relations that say nothing about where a vehicle ends beside another.
_LOOSE = ("in", "into", "along", "on", "with", "of", "for", "object")
_SIGNALS = ("honk", "flash", "beep", "toot", "hoot", "sound", "blow", "signal", "tap", "press", "use", "hit")
_LETTING = ("let", "allow", "permit", "letting", "allowing")


def settle(deed: Deed) -> str | None:
    """The action of a deed, None where it has nothing to do with driving; mends its relation and direction."""
    action = _lane_change(deed)
    if action is None:
        action = _plain(deed) if deed.meaning in ACTIONS else _FAMILIES.get(deed.meaning, _nothing)(deed)
    if action in ("park", "pull_over") and deed.relation == "toward":
        deed.relation = "near"
    passing = action == "overtake" and deed.relation in ("near", "toward", "left_of", "right_of")
    awaited = action in ("give_way", "wait") and deed.direct
    if action == "slow_down" and deed.away:
        deed.relation = "none"
    if deed.relation in _LOOSE or action == "avoid" or passing or awaited:
        deed.relation = "none"
    return action


def _nothing(deed: Deed) -> str | None:
    return None


def _lane_change(deed: Deed) -> str | None:
    """A lane that is named makes many verbs a change of lanes; None where none is."""
    pulls_in = deed.meaning == "park" and deed.word.endswith(("in", "into", "in to"))
    if deed.lane or deed.names(*_LANES):
        if deed.meaning not in _LANE_CHANGING and not pulls_in:
            return None
        side = (deed.lane or "").removesuffix("_lane")
        if side in ("left", "right"):
            deed.direction = deed.direction or side
        return "change_lane"
    theirs = [word for word in deed.target.qualifiers if word.endswith("_lane")] if deed.target is not None else []
    beside = deed.relation in _BESIDE and (pulls_in or deed.meaning in ("get", "move"))
    return "change_lane" if beside and theirs and theirs != ["own_lane"] else None


# ---------------------------------------------------------------- verbs that mean one action


def _plain(deed: Deed) -> str | None:
    if deed.word.split()[0] in _SIGNALS:
        deed.relation = "none"
    return _PLAIN.get(deed.meaning, _as_said)(deed)


def _as_said(deed: Deed) -> str | None:
    return deed.meaning


def _odd(thing: Phrase | None) -> bool:
    """Whether a thing has nothing to do with driving, as far as is known."""
    return thing is not None and (thing.kind == "part" or not thing.known)


def _park(deed: Deed) -> str:
    """Pulling into a parking lot enters it."""
    enters = deed.word.startswith("pull") and deed.relation not in _BESIDE and deed.names(*_LOTS, "road")
    return "turn" if enters else "park"


def _stop_or_pass(deed: Deed) -> str | None:
    """Not "stop the music", "pass the salt"."""
    if deed.word.startswith("get off") and deed.names("entrance"):
        return "turn"
    strict = deed.word.split()[0] in ("stop", "pass", "pick", "drop", "roll", "put", "set", "draw")
    return None if strict and deed.target is None and _odd(deed.object) else deed.meaning


def _turn(deed: Deed) -> str | None:
    if deed.round and deed.target is not None and (deed.direction in (None, "around") or deed.word[:4] != "turn"):
        deed.direction = None if deed.direction == "around" else deed.direction
        return "overtake"  # "go left around the van"
    if "back" in deed.word and deed.target is not None:
        deed.direction = None
        return "approach"
    thing = deed.object
    elsewhere = thing is not None and thing.kind != "region" and thing.noun not in _ENTERED
    odd = any(relation in ("on", "along") and _odd(one) for relation, one in deed.marks)  # "turn on the radio"
    return None if deed.direction is None and (elsewhere or odd) else "turn"


def _slow_down(deed: Deed) -> str:
    """Driving slowly past the bus passes it."""
    word = deed.word.split()[0]
    if word in ("inch", "creep", "crawl") and deed.target is not None and deed.relation != "past":
        return "approach"
    drives = word in ("drive", "go", "pass", "continue", "proceed", "move", "inch", "creep", "crawl")
    if drives and deed.target is not None and (deed.round or deed.relation == "past"):
        return "overtake" if deed.round else "drive_past"
    return "slow_down"


def _go_on(deed: Deed) -> str:
    """On: behind another vehicle, past it, or until beside it."""
    if deed.spot or (deed.there and deed.word.startswith(("reverse", "back"))):
        return "park"
    if deed.target is None:
        return "other"
    if deed.word.startswith(("reverse", "back")):
        return "park" if deed.relation == "between" else "other" if deed.relation == "none" else "approach"
    beside = dict.fromkeys(("next_to", "in_front_of", "near"), "approach")
    return ({"behind": "follow", "past": "drive_past"} | beside).get(deed.relation, "other")


def _follow(deed: Deed) -> str | None:
    """Not "follow me on the net"; "follow the road" is to go on."""
    if deed.target is None and deed.marks:
        if all(_odd(thing) for _, thing in deed.marks):
            return None
        if deed.object is not None and deed.object.kind == "region":
            return "other"
    return "follow"


def _give_way(deed: Deed) -> str | None:
    nobody = deed.target is None and deed.object is None and deed.waits_for is None
    return None if nobody and deed.word in _LETTING else "give_way"


_PLAIN: Mapping[str, Callable[[Deed], str | None]] = {
    "park": _park,
    "stop": _stop_or_pass,
    "overtake": _stop_or_pass,
    "turn": _turn,
    "slow_down": _slow_down,
    "other": _go_on,
    "follow": _follow,
    "give_way": _give_way,
}


# ---------------------------------------------------------------- light verbs


def _motion(deed: Deed) -> str | None:
    """Go, drive, move, get, pull."""
    verb, relation = deed.meaning, deed.relation
    sideways = verb in ("get", "move", "pull")
    solid = deed.target is not None or any(thing.kind in ("thing", "person") for _, thing in deed.marks)
    corner = deed.names(*_ROUND) or any(thing.head == "block" for _, thing in deed.marks)
    if deed.round and (solid or corner):
        deed.relation = "none"
        return "turn" if deed.target is None and corner else "overtake"
    if deed.direction in ("left", "right") and (deed.target is None or relation not in (*_BESIDE, "toward", "past")):
        return "turn" if verb in ("go", "drive") else "change_lane"
    if relation == "past":
        return "overtake" if verb == "get" else "drive_past"
    if relation == "same_as":
        return "change_lane" if sideways else "follow"
    if relation == "between" and sideways and verb != "get":
        return "change_lane"
    if not deed.there and any(said in ("into", "in") and thing.noun in _LOTS for said, thing in deed.marks):
        return "turn"
    return _motion_without(deed) if deed.target is None else _motion_to(deed)


def _motion_to(deed: Deed) -> str | None:
    """To a vehicle; "move the car" is no driving command."""
    verb, relation = deed.meaning, deed.relation
    if deed.direct and relation == "none":
        return None
    if deed.away:
        deed.relation = "none"
        return "avoid"
    if deed.spot:
        return "park"
    if verb == "pull" and relation != "in_front_of":
        return "stop"
    return "follow" if relation == "behind" and verb == "drive" else "approach"


def _motion_without(deed: Deed) -> str | None:
    """Without a vehicle: to a thing, or on."""
    verb = deed.meaning
    named = [relation for relation, _ in deed.marks if relation != "object"]
    if deed.spot:
        return "park"
    if (deed.object is not None and not named) or (
        deed.marks and all(thing.kind == "part" for _, thing in deed.marks)
    ):
        return None
    if verb == "pull" and deed.direction != "straight":
        return "pull_over" if deed.side or deed.direction else "stop" if named or deed.there else None
    if deed.there or any(relation not in _LOOSE for relation in named):
        return "approach"
    told = named or deed.distances or deed.direction or deed.side or deed.optional
    return "other" if told or verb in ("go", "drive", "move") else None


def _stay(deed: Deed) -> str | None:
    """Stay, keep, hold."""
    between = deed.relation == "between" and deed.distances  # "keep 5 metres between us and the bus"
    gap = deed.distances and deed.target is not None and deed.relation in ("none", "toward")
    if deed.away or between or gap or _leaves_room(deed):
        return "avoid"
    if deed.relation in ("behind", "same_as", "next_to", "near") and deed.target is not None:
        return "follow"
    word = deed.word.split()[0]
    if word.startswith(("hold", "be")) and not (deed.lane or deed.target):
        return None
    told = deed.lane or deed.side or deed.direction or deed.marks or deed.target or deed.optional
    return "other" if told else "wait" if word.startswith(("stay", "remain")) else None


def _leaves_room(deed: Deed) -> bool:
    return any(thing.head in _KEPT_FREE for _, thing in deed.marks)


def _take(deed: Deed) -> str | None:
    """Take, make, find, use and their like: their object decides."""
    thing, word = deed.object, deed.word.split()[0]
    searches = word.startswith(("find", "look", "search")) and deed.names("parking_lot")
    if deed.spot or deed.there or searches:
        return "park"
    if word.startswith("pick") and thing is not None and thing.kind == "person":
        return "stop"
    deed.direction, deed.side = deed.direction or deed.side, None
    entered = thing is not None and thing.noun in _ENTERED and (thing.noun == "turn" or word not in ("make", "do"))
    return "turn" if deed.direction or entered else None


def _bring(deed: Deed) -> str | None:
    named = any(relation != "object" for relation, _ in deed.marks)
    if deed.relation == "past":
        return "drive_past"
    told = named or deed.there or "home" in deed.word or (deed.target is not None and not deed.direct)
    return "approach" if told else None


def _leave(deed: Deed) -> str | None:
    if _leaves_room(deed) or deed.distances:
        return "avoid"
    return "other" if deed.spot or deed.names("road", "parking_lot", "lane", "driveway") else None


def _give(deed: Deed) -> str | None:
    if any(thing.head in _SIGNALS for _, thing in deed.marks):
        return "other"  # "give it a honk"
    return "give_way" if deed.event else "avoid" if _leaves_room(deed) else None


_FAMILIES: Mapping[str, Callable[[Deed], str | None]] = {
    **dict.fromkeys(("go", "drive", "move", "get", "pull"), _motion),
    "stay": _stay,
    "take": _take,
    "bring": _bring,
    "leave": _leave,
    "give": _give,
}
