"""Values of a query that language, referents and goals share: actions, relations, states, triggers and colours."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal, get_args

Action = Literal[
    "park",
    "stop",
    "pull_over",
    "follow",
    "approach",
    "overtake",
    "drive_past",
    "turn",
    "change_lane",
    "wait",
    "slow_down",
    "give_way",
    "avoid",
    "other",
]
Relation = Literal[
    "none",
    "behind",
    "in_front_of",
    "next_to",
    "near",
    "left_of",
    "right_of",
    "opposite",
    "between",
    "past",
    "before",
    "at",
    "toward",
    "same_as",
]
# Motion states of a vehicle, as qualifiers.
State = Literal[
    "parked",
    "stopped",
    "moving",
    "oncoming",
    "same_way",
    "turning",
    "turning_left",
    "turning_right",
    "leaving",
    "passing",
    "braking",
]
# Events of another vehicle that a command waits for.
Trigger = Literal["pass", "leave", "turn", "stop", "merge", "clear", "other"]
# Changes of a place; "away" and "near" are relative to the vehicle that it is measured from.
ShiftDirection = Literal["away", "near", "ahead", "back", "leftwards", "rightwards"]
# Positions that ordinals name; "next" counts from where we are.
POSITIONS: Mapping[str, int] = {"first": 1, "second": 2, "third": 3, "fourth": 4, "fifth": 5, "sixth": 6}
ORDINALS: Mapping[str, int] = {**POSITIONS, "next": 1}
# Manoeuvres that are refused, and all ways to drive that a verb names beyond its action.
Refused = Literal["pavement", "oncoming_lane", "red_light", "push", "double_park", "off_road", "speeding"]
Manoeuvre = Literal["onward", "back", "creep", "faster", Refused]
REFUSED: tuple[str, ...] = get_args(Refused)
ACTIONS: tuple[str, ...] = get_args(Action)
RELATIONS: tuple[str, ...] = get_args(Relation)[1:]  # without "none"
STATES: tuple[str, ...] = get_args(State)
TRIGGERS: tuple[str, ...] = get_args(Trigger)
MANOEUVRES: tuple[str, ...] = get_args(Manoeuvre)
# Actions that lead past a vehicle.
PASSING_ACTIONS: tuple[Action, ...] = ("overtake", "drive_past")
# What a command asks for instead of a place: another speed, or to stand where we are.
Pace = Literal["slower", "faster", "standing"]
# Nouns of vehicles and of people, and of all objects that a scene can hold.
VEHICLE_NOUNS = frozenset(
    ("car", "van", "truck", "bus", "trailer", "motorcycle", "bicycle", "construction_vehicle", "vehicle")
)
PERSON_NOUNS = frozenset(("person", "people", "pedestrian", "man", "woman", "child"))
KNOWN_NOUNS = VEHICLE_NOUNS | PERSON_NOUNS
# Nouns of landmarks that vector maps hold, and their kinds there.
LANDMARK_KINDS: dict[str, str] = {
    **dict.fromkeys(("crossing", "zebra_crossing", "pedestrian_crossing", "crosswalk", "zebra"), "crossing"),
    **dict.fromkeys(("pedestrian_crosswalk", "cross_walk"), "crossing"),
    **dict.fromkeys(("stop_line", "stopping_line", "white_line"), "stop line"),
    **dict.fromkeys(("traffic_light", "traffic_signal"), "traffic light"),
    **dict.fromkeys(("stop_sign",), "stop sign"),
    **dict.fromkeys(("junction", "intersection", "crossroad", "crossroads", "t_junction", "roundabout"), "junction"),
    **dict.fromkeys(("corner", "street_corner", "bend", "curve"), "junction"),
    **{
        f"end_of_{the}_{road}": "junction"
        for the in ("the", "this", "that", "our", "my")
        for road in ("road", "street", "lane", "alley", "block", "avenue")
    },
    **dict.fromkeys(("car_park", "parking_lot", "parking_area", "parking_garage"), "car park"),
}
# Colour word -> basic colour.
COLOURS: dict[str, str] = {
    **{
        word: word
        for word in ("black", "grey", "silver", "white", "red", "orange", "brown", "yellow", "green", "blue")
    },
    **{word: word for word in ("purple", "pink", "beige", "tan", "maroon", "navy", "turquoise", "gold", "violet")},
    **{
        "crimson": "red",
        "scarlet": "red",
        "ruby": "red",
        "burgundy": "maroon",
        "magenta": "pink",
        "lavender": "purple",
    },
    **{"olive": "green", "lime": "green", "emerald": "green", "khaki": "tan", "mustard": "yellow", "bronze": "brown"},
    **{"copper": "brown", "chocolate": "brown", "charcoal": "grey", "cream": "beige", "champagne": "beige"},
    **{"ivory": "white", "teal": "turquoise", "cyan": "turquoise", "lilac": "violet", "indigo": "violet"},
}


def verb_of(action: str | None, relation: str) -> str:
    """Return the verb of an action in a phrase with a relation: "approach the van", but "go behind the van"."""
    if action == "approach" and relation != "none":
        return "go"
    return "drive" if action in (None, "other") else action
