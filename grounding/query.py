"""The query: typed meaning of a command, with the keys and values of labelled command files."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass, replace
from typing import Any, Literal

from grounding.vocabulary import LANDMARK_KINDS, Action, Manoeuvre, Pace, Relation, Trigger

# Relations of landmarks and exclusions, in addition to those of the goal.
Placement = Literal["in", "into", "on", "until", "around"]
# "with" and "of" come only from the parser: "the driver with the dog"; "closest_to" only from the resolver.
LandmarkRelation = Relation | Placement | Literal["with", "of", "for", "closest_to"]
# The thing that has the relation to the landmark; "inverse": the landmark has it to the referent; "partner": the
# other end of "between" has it to the referent.
LandmarkRole = Literal["goal", "referent", "inverse", "partner"]
# Origin of the goal relation: the referent or the first landmark.
Anchor = Literal["referent", "secondary"]
Direction = Literal["left", "right", "around", "straight"]
Side = Literal["left", "right"]
# Side of the road by its traffic: at our kerb, or the other one.
RoadSide = Literal["kerb", "opposite"]
# Meaning of a distance: gap between goal and referent, distance to drive, distance from the ego to the referent, gap
# between goal and the edge of the road.
DistanceRole = Literal["referent", "ego", "descriptor", "kerb"]

# What an action without a place asks for.
_PACES: dict[str, Pace] = {"slow_down": "slower", "wait": "standing"}
# First words of phrases that stand for a vehicle without a noun: "whatever is closest".
_UNNAMED = ("whatever", "whoever")
# Phrases of qualifiers that follow the noun.
_POSTMODIFIERS = {
    "left_side": "on the left",
    "right_side": "on the right",
    "opposite_side": "on the opposite side",
    "own_side": "on our side",
    "same_way": "facing the same way as us",
    "facing_us": "facing us",
    "ahead": "ahead",
    "behind_ego": "behind us",
    "beside_ego": "beside us",
    "at_end": "at the end",
    "in_row": "in the row",
    **{f"{which}_lane": f"in the {which} lane" for which in ("left", "right", "middle", "other")},
    "own_lane": "in our lane",
}
# Qualifiers that the labelled command files do not have.
_NOT_LABELLED = ("beside_ego", "at_end", "in_row", "facing_us")


def describe_qualifier(word: str) -> str:
    """Return a qualifier in words: "beside us" for "beside_ego"."""
    return _POSTMODIFIERS.get(word, word.replace("_", " "))


@dataclass(frozen=True)
class Referent:
    """The vehicle or person that a command refers to.

    Attributes:
        noun: class: car, van, truck, bus, trailer, motorcycle, bicycle, construction_vehicle, vehicle, person.
        head: the noun as written.
        colour: colour word as written ("grey" for "gray", may start with dark or light); None if none is named.
        qualifiers: ordinals, superlatives, sides, lanes, states and sizes, in order.
        qualifiers_optional: qualifiers that may describe the goal instead ("park up ahead behind X").
        number: 2 for "the two cars", else 1.
        anaphora: whether the argument of the action is a pronoun, "one" or a bare adjective.
        extra: descriptions that no map can show: make, owner, an open door.
        definite: True for "the" and "that", False for "a" and "any".
        in_line: True for "in front of us" and "behind us" (the next one in the ego lane), False for "ahead".
        clothes: colour of what a person wears: "the woman in the green coat"; None if none is named.
    """

    noun: str
    head: str
    colour: str | None = None
    qualifiers: tuple[str, ...] = ()
    _: KW_ONLY
    qualifiers_optional: tuple[str, ...] = ()
    number: int = 1
    anaphora: bool = False
    extra: tuple[str, ...] = ()
    definite: bool = True
    in_line: bool = False
    clothes: str | None = None

    def to_dict(self) -> dict[str, Any]:
        """Return the referent with the keys of labelled command files."""
        # The labelled files have neither clothes nor these qualifiers.
        more = [word for word in self.qualifiers if word in _NOT_LABELLED]
        named = {"clothes": self.clothes} if self.clothes else {}
        return (
            named
            | ({"more_qualifiers": more} if more else {})
            | {
                "noun": self.noun,
                "noun_alt": ["bicycle"] if self.head == "bike" else [],
                "head": self.head,
                "colour": self.colour,
                "qualifiers": [word for word in self.qualifiers if word not in more],
                "qualifiers_optional": list(self.qualifiers_optional),
                "number": self.number,
                "anaphora": self.anaphora,
                "extra": list(self.extra),
            }
        )

    def phrase(self) -> str:
        """Return the referent as an English noun phrase without an article."""
        before = [word.replace("_", " ") for word in self.qualifiers if word not in _POSTMODIFIERS]
        after = [_POSTMODIFIERS[word] for word in self.qualifiers if word in _POSTMODIFIERS]
        worn = f"in {self.clothes}" if self.clothes else ""
        head = self.noun if self.head.startswith(_UNNAMED) else self.head
        return " ".join(word for word in (*before, self.colour or "", head, worn, *after) if word)


@dataclass(frozen=True)
class Landmark:
    """Another thing in a command that locates the referent or the goal.

    Attributes:
        noun: vehicle nouns as in `Referent`, others such as lamp_post.
        relation: relation to the landmark.
        of: "goal": the goal has the relation; "referent": the referent has it; "inverse": the landmark has it to the
            referent; "partner": the other end of "between" has it to the referent.
        colour: as in `Referent`.
        qualifiers: as in `Referent`.
    """

    noun: str
    relation: LandmarkRelation
    of: LandmarkRole = "goal"
    colour: str | None = None
    qualifiers: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Return the landmark with the keys of "secondary" in labelled command files."""
        return {
            "noun": self.noun,
            "relation": self.relation,
            "of": self.of,
            "colour": self.colour,
            "qualifiers": list(self.qualifiers),
        }


@dataclass(frozen=True)
class Exclusion:
    """Objects that a command excludes.

    Attributes:
        relation: relation that the goal must not have to such an object; None if it must not be the referent.
        noun: as in `Landmark`.
        colour: as in `Referent`.
        distance_m: how far from such an object the goal must be: "not within 10 m of the crossing"; None: not said.
        qualifiers: as in `Referent`.
    """

    relation: LandmarkRelation | None
    noun: str
    colour: str | None = None
    qualifiers: tuple[str, ...] = ()
    distance_m: float | None = None

    def to_dict(self) -> dict[str, Any]:
        """Return the exclusion with the keys of labelled command files."""
        return {
            "relation": self.relation,
            "noun": self.noun,
            "colour": self.colour,
            "qualifiers": list(self.qualifiers),
            **({} if self.distance_m is None else {"distance_m": self.distance_m}),
        }


@dataclass(frozen=True)
class Query:
    """Parsed command: action, referent, place and manner. A query without an action is no command.

    Attributes:
        command: the sentence as given.
        action: main action; None if the sentence is no driving command.
        actions: all commanded actions in order; the main one is among them.
        relation: where the goal is, seen from the vehicle or landmark: behind, next to, past.
        landmark: anchor of the relation: the referent, or the first of `secondary`; None without one.
        referent: the vehicle or person that is named; None without one.
        secondary: other things that are named, such as a crossing.
        direction: where to steer.
        goal_side: side of the road on which the goal is; None if not named.
        road_side: the same side relative to traffic: "by the kerb", "on the other side of the road".
        trigger: event of the referent to wait for: "after the bus leaves"; None without one.
        distance_m: distance, metres; None if not named.
        distance_of: role of the distance: gap to the referent or the kerb, way to drive, or range of the referent.
        excluded: exclusions: "not the red one", "anywhere except behind the truck".
        count: number of the branch to turn into ("the third left" is 3), of the gap at the kerb to park in, or of
            lanes to change; None if not named.
        manoeuvre: manner of driving that the action does not give: onward, back, creep, faster, or a refused one.
        unresolved: pronoun or "one" without an antecedent; '' if there is none.
        sought: description of such a "one": a red vehicle for "the red one"; None without one.
    """

    command: str
    action: Action | None = None
    actions: tuple[Action, ...] = ()
    relation: Relation = "none"
    _: KW_ONLY
    landmark: Anchor | None = None
    referent: Referent | None = None
    secondary: tuple[Landmark, ...] = ()
    direction: Direction | None = None
    goal_side: Side | None = None
    trigger: Trigger | None = None
    distance_m: float | None = None
    distance_of: DistanceRole | None = None
    excluded: tuple[Exclusion, ...] = ()
    count: int | None = None
    manoeuvre: Manoeuvre | None = None
    unresolved: str = ""
    sought: Referent | None = None
    road_side: RoadSide | None = None

    @classmethod
    def short_of(cls, command: str, passed: Exclusion) -> Query:
        """Return the query of a stop short of what is not to be passed."""
        stop = cls(command, "stop", ("stop",), "before", excluded=(replace(passed, relation="past"),))
        if passed.noun in LANDMARK_KINDS:
            return replace(stop, landmark="secondary", secondary=(Landmark(passed.noun, "before"),))
        named = Referent(passed.noun, passed.noun, passed.colour, passed.qualifiers)
        return replace(stop, landmark="referent", referent=named)

    def on_side(self, traffic_side: int) -> Query:
        """Return the query with its side as left or right, where traffic drives on the right (1) or left (-1)."""
        if self.road_side is None or self.goal_side is not None:
            return self
        right = (self.road_side == "kerb") == (traffic_side > 0)
        return replace(self, goal_side="right" if right else "left")

    @property
    def limit(self) -> Exclusion | None:
        """What is not to be passed, if the command asks only for that: "no further than the van"."""
        passed = next((one for one in self.excluded if one.relation == "past"), None)
        return passed if self.action == "stop" and self.relation == "before" else None

    def at_excluded(self) -> Query:
        """Return a place before or past nothing as one at the landmark where we are not to stop: "stop after it"."""
        thing = next((one.noun for one in self.excluded if one.relation is None and one.noun in LANDMARK_KINDS), None)
        alone = self.landmark is None and self.referent is None and not self.secondary
        if thing is None or not alone or self.relation not in ("before", "past"):
            return self
        return replace(self, landmark="secondary", secondary=(Landmark(thing, self.relation),), excluded=())

    @property
    def crossed(self) -> str | None:
        """What a command drives through: a noun of the map, "junction" for straight on; None for nothing."""
        through = (one.noun for one in self.secondary if one.of == "goal" and one.relation in ("in", "into", "on"))
        known = (one for one in through if one in LANDMARK_KINDS)
        return next(known, "junction" if self.direction == "straight" else None)

    def beyond(self, crossed: str | None) -> Query:
        """Return a place past what is driven through: "go over it and stop", "... on the far side"."""
        if crossed is None or self.referent is not None or self.action not in ("park", "stop", "pull_over", "wait"):
            return self
        anywhere = self.relation == "none" and self.goal_side is None and self.distance_m is None
        through = any(one.relation == "into" and one.noun == crossed for one in self.secondary)
        onwards = self.road_side == "opposite" or (anywhere and through and LANDMARK_KINDS.get(crossed) != "car park")
        if not onwards:
            return self
        past = Landmark(crossed, "past")
        return replace(self, road_side=None, relation="past", landmark="secondary", secondary=(past,))

    @property
    def pace(self) -> Pace | None:
        """What a command without a place asks for: "slow down", "faster", "wait"; None if it asks for a place."""
        placed = self.relation != "none" or self.distance_m is not None or self.landmark == "secondary"
        if placed or self.goal_side or self.road_side or self.direction:
            return None
        if self.manoeuvre is not None:
            return "faster" if self.manoeuvre == "faster" else None
        return _PACES.get(self.action or "")

    def to_dict(self) -> dict[str, Any]:
        """Return the query with all keys of labelled command files; alternatives, set by annotators, are empty."""
        return {
            "command": self.command,
            "status": "ok" if self.action else "reject",
            "action": self.action,
            "action_alt": [],
            "actions": list(self.actions),
            "direction": self.direction,
            "goal_side": self.goal_side,
            "relation": self.relation,
            "relation_alt": [],
            "landmark": self.landmark,
            "referent": self.referent.to_dict() if self.referent else None,
            "secondary": [landmark.to_dict() for landmark in self.secondary],
            "trigger": self.trigger,
            "distance_m": self.distance_m,
            "distance_of": self.distance_of,
            "excluded": [exclusion.to_dict() for exclusion in self.excluded],
            "note": None,
            **({} if self.count is None else {"count": self.count}),
            **({} if self.manoeuvre is None else {"manoeuvre": self.manoeuvre}),
            **({} if self.road_side is None else {"road_side": self.road_side}),
            **({} if self.pace is None else {"pace": self.pace}),
        }
