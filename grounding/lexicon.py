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


# Values of actions and relations are those of the labelled command files; a second word of an action's value is the
# relation ("approach toward") or the direction ("turn left") that its phrase carries along.
_ACTIONS = {
    "park": "park [the|my|our|your|this] [car|vehicle]; find|take|grab|get [me|us] [a|the|that|this] [free|empty]"
    " [parking] spot|space|place [to park]; find|get [me|us] [some] parking; pull in [to]; pull into",
    "stop": "stop [the car]; halt; pause; pull up; drop me|us|them|him|her off|out; drop off; let me|us out;"
    " come to a|the stop|halt; get out|off",
    "pull_over": "pull over; pull to the side",
    "approach": "go; drive; move; get; head; come; navigate; proceed; line up; position yourself|us;"
    " go|drive|get home; take|drive|bring|get me|us home",
    "approach toward": "go|drive|move|head|come|get|navigate|proceed [up|over] to|toward|towards; approach;"
    " bring|take|drive|get me|us [over] to|toward|towards; get|go|drive|move closer to",
    "follow": "follow|following; keep up with; stay|keep|remain; tail",
    "follow behind": "drive|go behind",
    "overtake": "overtake; pass [by]; get|go|drive|move|steer|swerve around",
    "drive_past past": "go|drive|get|going|driving past; keep|continue going|driving past",
    "slow_down": "slow down; back off; brake; go|drive slower|slowly; reduce speed",
    "wait": "wait [right] [here|there] [for]; stay here|there|put; hold on",
    "give_way": "give way [to]; yield [to]; let|allow; make way|room for",
    "avoid": "avoid; look|watch out [for]; be careful [of|with]; careful; keep away from; steer clear of;"
    " keep [a|your|some] [safe] distance [from|to]",
    "other": "continue; keep going|driving|moving; speed up; accelerate; go|drive faster; back up; reverse; honk;"
    " keep|stay|remain in [the|our|this|your] [left|right] [hand] lane; keep|stay [to] [the] left|right",
    "other straight": "go|drive|continue|keep [going|driving] straight [on|ahead]",
    "turn": "turn; turn at|into|onto|in|back|here; enter",
    "turn around": "turn around; make|do|take a u-turn|you-turn; u-turn; you-turn",
    "change_lane": "change|switch [the] lane|lanes; merge [in|into|onto] [the] [lane|traffic];"
    " change|switch|move|get|merge|turn [over] in|into|to the [other|next|same|middle] lane",
}
_ACTIONS |= {
    f"turn {side}": f"turn|bear|steer {side}; take|make|hang a|the [sharp|next|first|second|third] {side} [turn]"
    for side in ("left", "right")
}
_ACTIONS |= {
    f"change_lane {side}": f"change|switch|move|get|merge|turn|go [over] in|into|to|onto [the] {side} [hand] lane;"
    f" change|switch lane|lanes [to] [the] {side}; merge [to] [the] {side}"
    for side in ("left", "right")
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
    "before": "[right|just|directly] before",
    "past": "[right|just|directly] after; past; beyond",
    "opposite": "opposite [of|to]; across from",
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
    "turning": "turning",
    "turning_left": "turning left",
    "turning_right": "turning right",
    "leaving": "leaving; pulling|backing|driving out|off|away",
    "passing": "passing [us|me|by]; overtaking [us|me]",
}
_SIDES = {
    f"{side}_side": f"[on|to|at] [the|our|my|your] [far] {side} [hand] [side]; on|to|at the {side} [hand] [side] of"
    " [the|our|this|that|my|your] us|me|road|street|lane"
    for side in ("left", "right")
} | {f"from_{side}": f"from [the|our|my|your] [far] {side} [hand] [side]" for side in ("left", "right")}
_WHERES = {
    "ahead": "[up|straight|right|just] ahead; [up|straight|right|just] ahead of us|me|you; [right|straight] in front;"
    " in front of us|me|you; up front; up there",
    "behind_ego": "[right] behind us|me|you; in back of us|me",
    "own_lane": "in|on our|my|the way|path; in our|my lane; blocking [our|my|the] way|path|lane|road",
    **{f"{which}_lane": f"in the|our|my {which} [hand] lane" for which in ("left", "right", "middle", "other")},
}
_NUMBERS = {"2": "two", "3": "three", "4": "four", "5": "five", "6": "six", "7": "seven", "8": "eight"} | {
    "9": "nine",
    "10": "ten",
    "15": "fifteen",
    "20": "twenty",
}
_UNITS = {"1": "m; metre|metres|meter|meters", "0.3048": "ft; foot|feet", "0.9144": "yard|yards"}

# They change the meaning in ways that no grammar here reads, so they are told and never skipped.
_BEYOND = (
    "not; don't; dont; never; no; except; without; unless; anywhere; instead; between; across; until; when; where;"
    " same; other; while; it; him; her; them; its; one; both; cars|trucks|vans|buses|vehicles|motorcycles;"
    " in the same lane; lane|lanes"
)
# What can be placed. Other actions and relations are read, and so are these qualifiers; then it is told that they
# cannot be placed yet.
PLACED_ACTIONS = frozenset(("park", "stop", "pull_over", "approach"))
PLACED_RELATIONS = frozenset(("behind", "in_front_of", "next_to", "near", "left_of", "right_of", "toward"))
NOT_SEEN = frozenset(
    (
        *("turning", "turning_left", "turning_right", "leaving", "passing"),
        *("own_lane", "left_lane", "right_lane", "middle_lane", "other_lane"),
    )
)
DIRECTIONS = frozenset(("left", "right", "around", "straight"))
# Verbs of many meanings: with words beside them that are not understood they drive only where traffic is named.
WEAK_VERBS = frozenset(
    (
        *("get", "go", "move", "come", "turn", "pass", "wait", "let", "allow", "keep", "stay", "remain"),
        *("continue", "reverse", "enter"),
    )
)
# Courtesy, chatter and function words; those of the last line are there so that spelling repair leaves them alone.
_FILLERS = (
    "please; can; could; would; will; should; you; i; we; me; us; my; our; your; just; directly; [right] here; [over]"
    " there; right now|away|there; now; okay; ok; hey; hi; hello; thanks; thank you; want; need; like; wish; to; for;"
    " so; is; are; was; be; am; that is|are; that's; which is|are; who is; i'd; let's; kindly; maybe; immediately;"
    " quickly; slowly; carefully; somewhere; too; also; at; in; on; of; up; down; over; out; off; into; from; with;"
    " as; do; and; or; little bit; very; really; sir; man; mate; driver; what; which; who; side; way; straight;"
    " in|into [the|this|that|a] [free|empty] [parking] spot|space|place; a moment|minute|second|bit|while;"
    " turn on|off [the|your|my] [head] light|lights|headlights|wipers;"
    " block; trick; crown; about; these; three; think; sight; might; night; still; slack; whine; great; behold; story"
)
# What begins so asks something; "can", "could" and "would" begin polite commands, "when the bus leaves" a condition.
QUESTION = re.compile(
    r"(what|what's|whats|where|why|how|who|whose|which|is|are|was|were|does|did|has|have)\b"
    r"|when (do|does|did|is|are|was|were|will|can|shall|should)\b"
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
