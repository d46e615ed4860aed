"""The words of driving commands as data: phrase -> kind of token and value.

A phrase is written as a pattern: `a|b` is a choice, `[a|b]` may be left out. The longest phrase wins.
"""

from __future__ import annotations

import re
from enum import StrEnum
from functools import cache
from itertools import product


class Kind(StrEnum):
    """What a word is to the grammar."""

    ACTION = "ACTION"
    RELATION = "RELATION"
    NOUN = "NOUN"
    LANDMARK = "LANDMARK"
    COLOUR = "COLOUR"
    SHADE = "SHADE"
    ORDINAL = "ORDINAL"
    SUPERLATIVE = "SUPERLATIVE"
    STATE = "STATE"
    SIZE = "SIZE"
    SIDE = "SIDE"
    WHERE = "WHERE"
    THE = "THE"
    ANY = "ANY"
    NUMBER = "NUMBER"
    UNIT = "UNIT"
    BREAK = "BREAK"
    BEYOND = "BEYOND"
    FILLER = "FILLER"
    UNKNOWN = "UNKNOWN"


# Values of actions and relations are those of the labelled command files; "approach toward" carries a relation along.
_ACTIONS = {
    "park": "park [the|my|our|your|this] [car|vehicle]; find|take|grab|get [me|us] [a|the|that|this] [free|empty]"
    " [parking] spot|space|place [to park]; find|get [me|us] [some] parking; pull in [to]; pull into",
    "stop": "stop [the car]; halt; pause; pull up; drop me|us|them|him|her off|out; drop off; let me|us out;"
    " come to a|the stop|halt; get out|off",
    "pull_over": "pull over; pull to the side",
    "approach": "go; drive; move; get; head; come; navigate; proceed; line up; position yourself|us",
    "approach toward": "go|drive|move|head|come|get|navigate|proceed [up|over] to|toward|towards; approach;"
    " bring|take|drive|get me|us [over] to|toward|towards; get|go|drive|move closer to",
}
_RELATIONS = {
    "behind": "[right|just|directly|straight] behind; in [the] back of; at|on|to the rear|back of",
    "in_front_of": "[right|just|directly|straight] in [the] front of; infront of; ahead of; at|to the front of",
    "next_to": "[right|just|directly] next to; beside; alongside [of]; along side [of]; adjacent to; parallel to;"
    " level with; side by side with; abreast of",
    "near": "near [to]; close [by] to; nearby; by; around; in the vicinity of; not far from",
    "left_of": "[on|to|at] [the] left of; [on|to|at] [the] left [hand] side of",
    "right_of": "[on|to|at] [the] right of; [on|to|at] [the] right [hand] side of",
    "toward": "toward; towards",
}
_NOUNS = {
    "car": "car; sedan; suv; jeep; taxi; cab; 4x4; hatchback; estate [car]; station wagon; wagon; convertible; coupe;"
    " automobile; police car; sports car",
    "van": "van; minivan; delivery van; camper [van]",
    "truck": "truck; lorry; pickup [truck]; pick up truck; semi; big rig; box|fire|garbage|delivery|dump|tow truck",
    "bus": "bus; coach; minibus; school bus; shuttle",
    "trailer": "trailer",
    "motorcycle": "motorcycle; motorbike; motor bike; bike; scooter; moped",
    "construction_vehicle": "construction vehicle; digger; excavator; bulldozer; forklift",
    "vehicle": "vehicle",
}
# Things that a command may name and that the map does not hold.
_LANDMARKS = {
    "tree": "tree|trees",
    "lamp_post": "lamp post|posts; lamppost; street light|lamp; streetlight; light pole; pole",
    "traffic_light": "[traffic|stop] light|lights",
    "sign": "[stop|street|traffic] sign",
    "building": "building; house; shop; store; wall; garage; entrance; hotel; restaurant; gate; fence",
    "bus_stop": "bus stop|station",
    "intersection": "intersection; junction; crossing; corner; crosswalk; zebra crossing; roundabout",
    "parking_lot": "parking lot|garage; car park; driveway",
    "parking_spot": "[parking] spot|space",
    "cone": "[traffic] cone|cones; barrier",
    "road": "road; street; kerb; curb; sidewalk; pavement",
    "person": "person; people; pedestrian; man; woman; guy; lady; friend; child; kid; boy; girl; worker; policeman",
    "bicycle": "bicycle; cyclist",
    "hydrant": "[fire] hydrant",
}
_COLOURS = {
    **{
        word: word
        for word in ("black", "white", "red", "green", "yellow", "blue", "brown", "orange", "pink", "purple")
    },
    **{word: word for word in ("beige", "maroon", "tan", "navy", "turquoise")},
    "grey": "grey|gray",
    "silver": "silver|silvery",
    "gold": "gold|golden",
    "violet": "violet|lilac",
}
_STATES = {
    "parked": "parked",
    "stopped": "stopped; standing; waiting; stationary; idling",
    "moving": "moving; driving",
    "oncoming": "oncoming; coming|driving toward|towards us|me; facing us|me",
}
_SIDES = {
    f"{side}_side": f"[on|to|at|from] [the|our|my|your] [far] {side} [hand] [side]; on|to the {side} of us|me;"
    f" on|to|at the {side} [hand] side of [the] us|me|road|street"
    for side in ("left", "right")
}
_WHERES = {
    "ahead": "[up|straight|right|just] ahead; [up|straight|right|just] ahead of us|me|you; [right|straight] in front;"
    " in front of us|me|you; up front; up there",
    "behind_ego": "[right] behind us|me|you; in back of us|me",
}
_NUMBERS = {"2": "two", "3": "three", "4": "four", "5": "five", "6": "six", "7": "seven", "8": "eight"} | {
    "9": "nine",
    "10": "ten",
    "15": "fifteen",
    "20": "twenty",
}
_UNITS = {"1": "m; metre|metres|meter|meters", "0.3048": "ft; foot|feet", "0.9144": "yard|yards"}

# Understood, and outside of what can be placed: they change the meaning, so they are refused and never skipped.
_BEYOND = (
    "not; don't; dont; never; no; except; without; avoid; unless; anywhere; instead;"
    " follow|following; overtake|overtaking; pass|passing; turn [left|right|around]; u-turn; you-turn; merge;"
    " change|switch; slow [down]; continue; keep; stay; wait; yield; give way; let; look out; watch; speed up;"
    " back up; reverse; go|drive|move|get|steer around|past; drive|go behind;"
    " between; opposite [of]; across [from]; before; after; past; beyond; until; when; where; same; other; while;"
    " it; him; her; them; its; one; both; cars|trucks|vans|buses|vehicles|motorcycles;"
    " in the|our|my left|right|middle|other|same lane; in our|my|the lane|way|path; lane|lanes; turning; leaving"
)
# Courtesy, chatter and function words; those of the last line are there so that spelling repair leaves them alone.
_FILLERS = (
    "please; can; could; would; will; should; you; i; we; me; us; my; our; your; just; directly; [right] here; [over]"
    " there; right now|away|there; now; okay; ok; hey; hi; hello; thanks; thank you; want; need; like; wish; to; for;"
    " so; is; are; was; be; am; that is|are; that's; which is|are; who is; i'd; let's; kindly; maybe; immediately;"
    " quickly; slowly; carefully; somewhere; too; also; at; in; on; of; up; down; over; out; off; into; from; with;"
    " as; do; and; or; little bit; very; really; sir; man; mate; driver; what; which; who; side; way; straight;"
    " in|into [the|this|that|a] [free|empty] [parking] spot|space|place;"
    " block; trick; crown; about; these; three; think; sight; might; night; still; slack; whine; great; behold"
)
# A sentence that begins with one of these asks something; "can", "could" and "would" begin polite commands.
QUESTION_WORDS = frozenset(
    (
        *("what", "what's", "whats", "where", "why", "how", "who", "whose", "when", "which"),
        *("is", "are", "was", "were", "does", "did", "has", "have"),
    )
)
_TABLES: dict[Kind, dict[str, str]] = {
    Kind.FILLER: {"": _FILLERS},
    Kind.BEYOND: {"": _BEYOND},
    Kind.ACTION: _ACTIONS,
    Kind.RELATION: _RELATIONS,
    Kind.LANDMARK: _LANDMARKS,
    Kind.NOUN: _NOUNS,
    Kind.COLOUR: _COLOURS,
    Kind.SHADE: {"dark": "dark|darker; deep", "light": "light|lighter; pale; bright"},
    Kind.ORDINAL: {"first": "first|1st", "second": "second|2nd", "third": "third|3rd", "fourth": "fourth|4th"}
    | {"next": "next", "last": "last"},
    Kind.SUPERLATIVE: {
        "nearest": "nearest|closest",
        "farthest": "farthest|furthest; most distant",
        "leftmost": "leftmost; left most",
        "rightmost": "rightmost; right most",
        "largest": "largest|biggest",
        "smallest": "smallest",
    },
    Kind.STATE: _STATES,
    Kind.SIZE: {"large": "large|big|huge", "small": "small|little|tiny"},
    Kind.SIDE: _SIDES,
    Kind.WHERE: _WHERES,
    Kind.THE: {"the": "the|that|this"},
    Kind.ANY: {"a": "a|an|any|some"},
    Kind.NUMBER: _NUMBERS,
    Kind.UNIT: _UNITS,
    Kind.BREAK: {"": "and then; then; and after that"},
}


@cache
def phrases() -> dict[tuple[str, ...], tuple[Kind, str]]:
    """Every phrase of the lexicon, word by word, with its kind and value; later tables win."""
    book: dict[tuple[str, ...], tuple[Kind, str]] = {}
    for kind, table in _TABLES.items():
        for value, patterns in table.items():
            for pattern in patterns.split(";"):
                book.update(dict.fromkeys(_expanded(pattern), (kind, value)))
    book.pop((), None)
    return book


def _expanded(pattern: str) -> list[tuple[str, ...]]:
    """All phrases of a pattern."""
    choices = []
    for part in re.findall(r"\[[^]]*\]|\S+", pattern):
        words = part.strip("[]").split("|")
        choices.append(["", *words] if part.startswith("[") else words)
    return [tuple(" ".join(words).split()) for words in product(*choices)]
