"""What a sentence asks for: the typed query, with the keys and values of labelled command files."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

# Qualifiers that English says after the noun.
_AFTER = {
    "left_side": "on the left",
    "right_side": "on the right",
    "opposite_side": "on the opposite side",
    "ahead": "ahead",
    "behind_ego": "behind us",
    **{f"{which}_lane": f"in the {which} lane" for which in ("left", "right", "middle", "other")},
    "own_lane": "in our lane",
}


@dataclass(frozen=True)
class Referent:
    """The vehicle a command refers to.

    Attributes:
        noun: what the word stands for: car, van, truck, bus, trailer, motorcycle, bicycle, construction_vehicle,
            vehicle, person.
        head: the word that was used.
        colour: colour word as used (grey for gray; with dark or light before it), None where none is named.
        qualifiers: ordinals, superlatives, sides, lanes, states and sizes, in order.
        qualifiers_optional: said of the place rather than of the vehicle ("park up ahead behind X").
        number: 2 for "the two cars", else 1.
        anaphora: whether the action's own argument is a pronoun, "one" or a bare adjective.
        extra: what is said of it that no map can show: make, owner, an open door.
        definite: "the", "that" (one certain vehicle) and not "a", "any" (whichever suits).
        in_line: "in front of us", "behind us" (the next one in our lane) and not just "ahead".
    """

    noun: str
    head: str
    colour: str | None = None
    qualifiers: tuple[str, ...] = ()
    qualifiers_optional: tuple[str, ...] = ()
    number: int = 1
    anaphora: bool = False
    extra: tuple[str, ...] = ()
    definite: bool = True
    in_line: bool = False

    def to_dict(self) -> dict[str, Any]:
        """The referent as the labelled files write it."""
        return {
            "noun": self.noun,
            "noun_alt": ["bicycle"] if self.head == "bike" else [],
            "head": self.head,
            "colour": self.colour,
            "qualifiers": list(self.qualifiers),
            "qualifiers_optional": list(self.qualifiers_optional),
            "number": self.number,
            "anaphora": self.anaphora,
            "extra": list(self.extra),
        }

    def phrase(self) -> str:
        """The referent in words, for people."""
        before = [word.replace("_", " ") for word in self.qualifiers if word not in _AFTER]
        after = [_AFTER[word] for word in self.qualifiers if word in _AFTER]
        return " ".join(word for word in (*before, self.colour or "", self.head, *after) if word)


@dataclass(frozen=True)
class Landmark:
    """A further thing that a command names.

    Attributes:
        noun: what the word stands for; nouns of vehicles as in `Referent`, others such as lamp_post.
        relation: as in `Query`; also in, into, on, until, around.
        of: "referent" (the referent is <relation> the thing), "goal" (the goal is), or "inverse" (the thing is
            <relation> the referent).
        colour: as in `Referent`.
        qualifiers: as in `Referent`.
    """

    noun: str
    relation: str
    of: str = "goal"
    colour: str | None = None
    qualifiers: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """The landmark as the labelled files write a secondary one."""
        return {
            "noun": self.noun,
            "relation": self.relation,
            "of": self.of,
            "colour": self.colour,
            "qualifiers": list(self.qualifiers),
        }


@dataclass(frozen=True)
class Exclusion:
    """What a command rules out.

    Attributes:
        relation: the goal may not be <relation> such an object; None: no such object may be the referent.
        noun: as in `Landmark`.
        colour: as in `Referent`.
        qualifiers: as in `Referent`.
    """

    relation: str | None
    noun: str
    colour: str | None = None
    qualifiers: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """The exclusion as the labelled files write it."""
        return {
            "relation": self.relation,
            "noun": self.noun,
            "colour": self.colour,
            "qualifiers": list(self.qualifiers),
        }


@dataclass(frozen=True)
class Query:
    """A command, or (without an action) a sentence that is none.

    Attributes:
        command: the sentence as it was given.
        action: the primary one: park, stop, pull_over, follow, approach, overtake, drive_past, turn, change_lane,
            wait, slow_down, give_way, avoid, other; None for a sentence that is no driving command.
        actions: every commanded action in order, the primary one included.
        relation: where the ego ends relative to the landmark: behind, in_front_of, next_to, near, left_of, right_of,
            opposite, between, past, before, at, toward, same_as; none.
        landmark: what the relation is measured from: "referent", "secondary" (the first of them), None.
        referent: the vehicle, None where none is named.
        secondary: further things named.
        direction: left, right, around or straight, where the text orders so.
        goal_side: left or right side of the road for the goal itself, None where nothing is said.
        trigger: event that is awaited or starts the action: pass, leave, turn, stop, merge, clear, other; None.
        distance_m: a distance that is named, None where nothing is said.
        distance_of: what it is: referent (gap between the goal and the referent), ego (way to go), descriptor (the
            referent is that far away); None without one.
        excluded: what is ruled out.
    """

    command: str
    action: str | None = None
    actions: tuple[str, ...] = ()
    relation: str = "none"
    landmark: str | None = None
    referent: Referent | None = None
    secondary: tuple[Landmark, ...] = ()
    direction: str | None = None
    goal_side: str | None = None
    trigger: str | None = None
    distance_m: float | None = None
    distance_of: str | None = None
    excluded: tuple[Exclusion, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """All keys of the labelled files; alternatives are for people to label, so they are empty."""
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
        }
