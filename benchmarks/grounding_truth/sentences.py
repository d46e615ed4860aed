"""Descriptions of vehicles, their ambiguity, and the wording of commands."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from benchmarks.grounding_truth.key_frames import TrueFrame, Vehicle
from benchmarks.grounding_truth.places import Ask
from benchmarks.grounding_truth.roads import EGO

# Noun of a body, and undisputed words for it.
CALLED = {
    "sedan": ("car", ("car", "car", "sedan")),
    "hatchback": ("car", ("car", "car", "hatchback")),
    "estate": ("car", ("car", "car", "estate car", "station wagon")),
    "suv": ("car", ("suv", "suv", "car")),
    "minivan": ("van", ("van", "minivan")),
    "van": ("van", ("van",)),
    "pickup": ("truck", ("truck", "pickup truck", "pickup")),
    "box_truck": ("truck", ("truck", "lorry")),
    "bus": ("bus", ("bus",)),
    "motorcycle": ("motorcycle", ("motorcycle", "motorbike")),
}
# Bodies that some would call by a noun; from above, without heights, more of them look similar.
COULD_BE = {
    "car": frozenset({"sedan", "hatchback", "estate", "suv", "minivan", "van", "pickup"}),
    "van": frozenset({"van", "minivan", "suv", "box_truck"}),
    "truck": frozenset({"pickup", "box_truck", "van"}),
    "bus": frozenset({"bus", "box_truck"}),
    "motorcycle": frozenset({"motorcycle"}),
    "vehicle": frozenset(CALLED),
}
ALIKE_FROM_ABOVE = COULD_BE["car"] | COULD_BE["van"] | COULD_BE["truck"]
# Paints that can be confused in some light.
_CONFUSED = (
    *(("white", "silver"), ("white", "grey"), ("silver", "grey"), ("grey", "black"), ("grey", "blue")),
    *(("grey", "brown"), ("grey", "green"), ("black", "blue"), ("black", "brown"), ("black", "green")),
    *(("black", "purple"), ("blue", "purple"), ("blue", "green"), ("red", "orange"), ("red", "brown")),
    *(("red", "pink"), ("red", "purple"), ("purple", "pink"), ("orange", "brown"), ("orange", "yellow")),
    *(("white", "yellow"), ("silver", "blue"), ("white", "pink")),
)
CONFUSED = frozenset({*_CONFUSED, *((b, a) for a, b in _CONFUSED)})
PAINTS = tuple(sorted({paint for pair in _CONFUSED for paint in pair}))
# With fewer cells in the map, the colour is unreliable.
LEAST_CELLS = 10
# Certainly ahead, certainly behind; least offset from our path for a side.
AHEAD_M, AHEAD_DEG, BEHIND_M, SIDE_M = 6.0, 25.0, -4.0, 2.0
# Least separation for ordinals and superlatives; ordinals count along our own road.
STEP_M, STEP_SHARE, ROAD_M = 2.0, 0.1, 12.0
IN_LANE_M, OUT_OF_LANE_M = 0.9, 2.3
MOVES_MPS = 1.5
# Wordings to try before a vehicle counts as indistinguishable.
DRAWS = 80
ORDINALS = {"first": 1, "second": 2, "third": 3}
ORDERS = (*ORDINALS, "nearest", "farthest", "last", "leftmost", "rightmost")


class Description(NamedTuple):
    """Description of a vehicle; None for properties that are not mentioned.

    Attributes:
        noun: car, van, truck, bus, motorcycle, vehicle.
        paint: colour word.
        side: left or right of our path.
        state: parked or moving.
        order: one of ORDERS.
        lane: whether "in our lane" is mentioned.
        ahead: whether "ahead" is mentioned.
    """

    noun: str
    paint: str | None = None
    side: str | None = None
    state: str | None = None
    order: str | None = None
    lane: bool = False
    ahead: bool = False


# Referents --------------------------------------------------------------------------------------------------------


def certainly_fits(moment: TrueFrame, said: Description, v: Vehicle) -> bool:
    """Return whether a vehicle ahead fits the description without doubt, apart from its rank in an order."""
    aside = moment.sideways_m(v)
    return (
        v.visible
        and v.on_map
        and v.xy_m[0] > AHEAD_M
        and said.noun in (CALLED[v.body][0], "vehicle")
        and (said.paint is None or (v.paint == said.paint and v.cells >= LEAST_CELLS))
        and (said.side is None or min(_sides_m(moment, said, v)) >= SIDE_M)
        and (said.state is None or (v.parked and v.stationary if said.state == "parked" else v.speed_mps > MOVES_MPS))
        and (not said.lane or (moment.has_lane_to(v.xy_m[0]) and abs(aside) < IN_LANE_M and moment.is_along(v)))
        and (not said.ahead or abs(_bearing_deg(v)) < AHEAD_DEG)
    )


def may_fit(moment: TrueFrame, said: Description, v: Vehicle, blobs: bool, anywhere: bool = False) -> bool:
    """Return whether the description might mean a vehicle, visible or occluded; ahead of us, or `anywhere`."""
    aside = moment.sideways_m(v)
    bodies = ALIKE_FROM_ABOVE if blobs and said.noun in ("car", "van", "truck") else COULD_BE[said.noun]
    return (
        (v.visible or v.on_map)
        and (anywhere or v.xy_m[0] > BEHIND_M)
        and v.body in bodies
        and (said.paint is None or v.paint == said.paint or (v.paint, said.paint) in CONFUSED)
        and (said.side is None or max(_sides_m(moment, said, v)) > -SIDE_M)
        and (said.state is None or (v.speed_mps < MOVES_MPS if said.state == "parked" else not v.parked))
        and (not said.lane or abs(aside) < OUT_OF_LANE_M)
    )


def _sides_m(moment: TrueFrame, said: Description, v: Vehicle) -> tuple[float, float]:
    """Return the offsets of a vehicle to the mentioned side, of our path and of our heading: usage differs."""
    sign = 1 if said.side == "left" else -1
    return sign * moment.sideways_m(v), sign * float(v.xy_m[1])


def sole_referent(moment: TrueFrame, said: Description, blobs: bool) -> Vehicle | None:
    """Return the only vehicle that a description can mean, None if it is not beyond doubt."""
    might = [v for v in moment.vehicles if may_fit(moment, said, v, blobs)]
    if said.order is None:
        return might[0] if len(might) == 1 and certainly_fits(moment, said, might[0]) else None
    number = ORDINALS.get(said.order, 1)
    if said.order == "nearest":
        might = [v for v in moment.vehicles if may_fit(moment, said, v, blobs, anywhere=True)]
    might.sort(key=lambda v: _place(said.order, v))
    counted, after = might[:number], might[number : number + 1]
    if len(might) < max(number, 2) or not all(certainly_fits(moment, said, v) for v in counted):
        return None
    if said.order in ("farthest", "last") and not all(v.on_map for v in might):
        return None
    if said.order in (*ORDINALS, "last") and any(abs(moment.sideways_m(v)) > ROAD_M for v in [*counted, *after]):
        return None
    if said.order in ("leftmost", "rightmost"):
        outermost = (max if said.order == "leftmost" else min)(might, key=_bearing_deg)
        if outermost is not counted[0]:
            return None
    places = [_place(said.order, v) for v in [*counted, *after]]
    far = said.order in ("nearest", "farthest")
    steps = [b - a - (STEP_SHARE * abs(a) if far else 0) for a, b in pairwise(places)]
    return counted[-1] if min(steps, default=np.inf) >= STEP_M else None


def _place(order: str | None, v: Vehicle) -> float:
    """Return the sorting key of an order; the first vehicle has the lowest."""
    sign = -1 if order in ("farthest", "last", "leftmost") else 1
    if order in ("nearest", "farthest"):
        return sign * v.distance_m
    return sign * float(v.xy_m[1] if order in ("leftmost", "rightmost") else v.xy_m[0] - EGO.centre_m)


def _bearing_deg(v: Vehicle) -> float:
    """Return the bearing of a vehicle from the ego, left positive."""
    return float(np.degrees(np.arctan2(v.xy_m[1], v.xy_m[0] - EGO.centre_m)))


def describe(moment: TrueFrame, v: Vehicle, blobs: bool, random: np.random.Generator) -> Description | None:
    """Return a description that means only this vehicle, None if none is found."""
    aside = moment.sideways_m(v)
    for _ in range(DRAWS):
        draw = random.random(6)
        order = ORDERS[int(random.integers(len(ORDERS)))] if draw[3] < 0.25 else None
        state = ("parked" if v.parked else "moving") if draw[2] < 0.2 and not blobs else None
        said = Description(
            "vehicle" if draw[5] < 0.1 else CALLED[v.body][0],
            v.paint if draw[0] < 0.6 else None,
            ("left" if aside > 0 else "right") if draw[1] < 0.45 and order not in ("leftmost", "rightmost") else None,
            state,
            order,
            draw[4] < 0.3 and not order,
        )
        said = said._replace(ahead=draw[5] > 0.8 and not said.side and not said.lane)
        if sole_referent(moment, said, blobs) is v and not (said.lane and said.side):
            return said
    return None


# Words ------------------------------------------------------------------------------------------------------------

_ORDER_WORDS = {"nearest": ("nearest", "closest"), "farthest": ("farthest", "furthest")}
_SIDE_WORDS = ("on the {}", "on the {}", "on our {}", "on the {} side", "on the {}-hand side")
_LANE_WORDS = ("in our lane", "in my lane", "ahead in our lane")
_AHEAD_WORDS = ("ahead", "up ahead")
_STATE_CLAUSES = {"parked": "that is parked", "moving": "that is moving"}
_VERBS = {
    "park": ("park", "park", "park the car", "find a parking spot", "find a place to park"),
    "stop": ("stop", "stop", "pull up", "come to a stop", "halt", "stop the car"),
    "pull_over": ("pull over", "pull over", "pull the car over"),
    "approach": ("get", "go", "move"),
}
_PREPOSITIONS = {
    "behind": ("behind", "behind", "right behind", "directly behind", "just behind", "in back of"),
    "in_front_of": ("in front of", "in front of", "right in front of", "directly in front of", "just in front of"),
    "next_to": ("next to", "next to", "beside", "alongside", "right beside"),
    "near": ("near", "near", "close to", "not far from", "somewhere near"),
    "left_of": ("to the left of", "left of", "on the left side of", "on the left of"),
    "right_of": ("to the right of", "right of", "on the right side of", "on the right of"),
    "before": ("before", "just before", "right before", "a little before"),
    "past": ("after", "past", "just after", "just past", "right after"),
    "opposite": ("opposite", "across from", "across the road from", "on the other side of the road from"),
    "between": ("between", "between", "in between", "in the gap between"),
    "at": ("where {} is", "exactly where {} is"),
}
_OBJECT_VERBS = {
    "toward": ("drive towards", "head toward", "go over to", "drive up to", "approach", "get closer to"),
    "follow": ("follow", "follow", "keep following", "keep up with", "stay behind"),
    "overtake": ("overtake", "pass", "go around", "drive around", "get around"),
    "drive_past": ("drive past", "go past", "keep going past", "continue past"),
}
_PLAIN = {"behind": "behind", "in_front_of": "in front of", "before": "before", "past": "past"}
_NOTHING = {
    "pull_over": ("pull over {}", "pull over {}", "pull to the side {}", "pull over {} of the road"),
    "park": ("park {}", "find a parking spot {}", "park the car {}", "park {} of the road"),
    "stop": ("stop in {}", "stop after {}", "stop {} ahead", "come to a stop in {}"),
}
_MANNERS = (
    *("{}", "{}", "{}", "{}", "please {}", "{}, please", "{} please", "can you {}?", "could you {}, please?"),
    *("you can {}", "I want you to {}", "I'd like you to {}", "let's {}", "ok, {}", "now {}", "{}, thanks"),
)
_BEFOREHAND = ("there is {a}. {do}", "do you see {the}? {do}", "see {the}? {do}", "{the}, {do}")
_NUMBERS = {2: "two", 3: "three", 4: "four", 5: "five", 10: "ten", 15: "fifteen", 20: "twenty"}


def phrase(said: Description, body: str, random: np.random.Generator, article: str = "the", number: int = 1) -> str:
    """Return a description in words; a known body may be called by its own name."""
    # Ordinals over SUVs and over cars differ: only without an order may the name of a body replace its noun.
    own_name = body in CALLED and said.noun != "vehicle" and not said.order
    heads = CALLED[body][1] if own_name else (said.noun,)
    order = _pick(_ORDER_WORDS.get(said.order, (said.order,)), random) if said.order else ""
    colour = said.paint or ""
    colour = "gray" if colour == "grey" and random.random() < 0.5 else colour
    clause = said.state is not None and random.random() < 0.3
    head = _pick(heads, random) + ("es" if said.noun == "bus" and number > 1 else "s" if number > 1 else "")
    tails = [_STATE_CLAUSES[said.state]] if said.state and clause and number == 1 else []
    state = said.state if said.state and not tails else ""
    if said.side:
        tails.append(_pick(_SIDE_WORDS, random).format(said.side))
    elif said.lane:
        tails.append(_pick(_LANE_WORDS, random))
    elif said.ahead:
        tails.insert(0, _pick(_AHEAD_WORDS, random))
    words = [word for word in (order, "two" if number > 1 else "", state, colour, head, *tails) if word]
    if article == "a" and not order:
        article = "an" if words[0][0] in "aeo" else "a"
    return " ".join(["the" if order else article, *words])


def command(
    relation: str,
    ask: Ask,
    names: Sequence[tuple[Description, str]],
    random: np.random.Generator,
    definite: bool = False,
) -> str:
    """Return a command with a relation to vehicles (descriptions with bodies); `definite`: no article "a"."""
    if relation == "none":
        return _polite(_to_nothing(ask, random), random)
    objects = [phrase(said, body, random) for said, body in names]
    if relation == "between" and len(names) == 2 and names[0][0] == names[1][0]:
        bodies = {body for _, body in names}
        # Two vehicles of different bodies are called by their common noun.
        objects = [phrase(names[0][0], bodies.pop() if len(bodies) == 1 else "", random, number=2)]
    if len(names) == 1 and random.random() < 0.1:
        do = _to_object(relation, ask, "it", random)
        a, the = (phrase(*names[0], random, article) for article in ("a", "the"))
        beforehand = [words for words in _BEFOREHAND if not (definite and "{a}" in words)]
        return _pick(beforehand, random).format(a=a, the=the, do=do)
    return _polite(_to_object(relation, ask, " and ".join(objects), random), random)


def _to_object(relation: str, ask: Ask, it: str, random: np.random.Generator) -> str:
    if relation in _OBJECT_VERBS:
        return f"{_pick(_OBJECT_VERBS[relation], random)} {it}"
    verb = _pick(_VERBS[ask.action], random)
    if relation == "at":
        return f"{verb} {'to ' if ask.action == 'approach' else ''}{_pick(_PREPOSITIONS['at'], random)}".format(it)
    if ask.said_m is not None:
        return f"{verb} {_metres(ask.said_m, random)} {_PLAIN[relation]} {it}"
    return f"{verb} {_pick(_PREPOSITIONS[relation], random)} {it}"


def _to_nothing(ask: Ask, random: np.random.Generator) -> str:
    words = _pick(_NOTHING[ask.action], random)
    if ask.said_m is not None:
        return words.format(_metres(ask.said_m, random))
    if not ask.side:
        return words.split(" {}")[0]
    return words.format(f"on the {ask.side} side" if " of the" in words else _side(ask.side, random))


def _side(side: str, random: np.random.Generator) -> str:
    return _pick(("on the {}", "on the {} side", "on the {}-hand side", "to the {}"), random).format(side)


def _metres(length_m: float, random: np.random.Generator) -> str:
    if round(length_m) != length_m:
        return f"{round(length_m / 0.3048)} {_pick(('feet', 'ft'), random)}"
    number = round(length_m)
    word = _NUMBERS[number] if number in _NUMBERS and random.random() < 0.3 else str(number)
    return f"{word} {_pick(('metres', 'meters', 'm') if word.isdigit() else ('metres', 'meters'), random)}"


def _polite(text: str, random: np.random.Generator) -> str:
    text = _pick(_MANNERS, random).format(text)
    return text[0].upper() + text[1:] + ("" if text.endswith("?") else ".") if random.random() < 0.4 else text


def _pick(words: Sequence[str], random: np.random.Generator) -> str:
    return words[int(random.integers(len(words)))]
