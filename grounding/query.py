"""What a sentence asks for: the typed query, with the keys and values of labelled command files."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

# Qualifiers that English says after the noun.
_AFTER = {"left_side": "on the left", "right_side": "on the right", "ahead": "ahead", "behind_ego": "behind us"}


@dataclass(frozen=True)
class Referent:
    """The vehicle a command refers to.

    Attributes:
        noun: what the word stands for: car, van, truck, bus, trailer, motorcycle, construction_vehicle, vehicle.
        head: the word that was used.
        colour: colour word as used (grey for gray; with dark or light before it), None where none is named.
        qualifiers: ordinals, superlatives, sides, states and sizes, in order.
        qualifiers_optional: said of the place rather than of the vehicle ("park up ahead behind X").
        definite: "the", "that" (one certain vehicle) and not "a", "any" (whichever suits).
    """

    noun: str
    head: str
    colour: str | None = None
    qualifiers: tuple[str, ...] = ()
    qualifiers_optional: tuple[str, ...] = ()
    definite: bool = True

    def to_dict(self) -> dict[str, Any]:
        """The referent as the labelled files write it."""
        return {
            "noun": self.noun,
            "noun_alt": ["bicycle"] if self.head == "bike" else [],
            "head": self.head,
            "colour": self.colour,
            "qualifiers": list(self.qualifiers),
            "qualifiers_optional": list(self.qualifiers_optional),
            "number": 1,
            "anaphora": False,
            "extra": [],
        }

    def phrase(self) -> str:
        """The referent in words, for people."""
        before = [word for word in self.qualifiers if word not in _AFTER]
        after = [_AFTER[word] for word in self.qualifiers if word in _AFTER]
        return " ".join(word for word in (*before, self.colour or "", self.head, *after) if word)


@dataclass(frozen=True)
class Landmark:
    """A thing other than a vehicle that a command names; the map does not hold it."""

    noun: str
    relation: str

    def to_dict(self) -> dict[str, Any]:
        """The landmark as the labelled files write a secondary one."""
        return {"noun": self.noun, "relation": self.relation, "of": "goal", "colour": None, "qualifiers": []}


@dataclass(frozen=True)
class Query:
    """A command, or (without an action) a sentence that is none.

    Attributes:
        command: the sentence as it was given.
        action: park, stop, pull_over, approach, or one that cannot be placed: follow, turn, overtake, ...; None for a
            sentence that is no driving command.
        relation: where the ego ends relative to the referent: behind, in_front_of, next_to, near, left_of, right_of,
            toward; before, past, opposite, which cannot be placed; none.
        referent: the vehicle, None where none is named.
        goal_side: left or right side of the road for the goal itself, None where nothing is said.
        landmarks: other things named.
        distance_m: a distance that is named, None where nothing is said.
        distance_of: what it is: referent (gap between the goal and the referent), ego (way to go), descriptor (the
            referent is that far away); None without one.
        direction: left, right, around or straight, where the action says so.
    """

    command: str
    action: str | None = None
    relation: str = "none"
    referent: Referent | None = None
    goal_side: str | None = None
    landmarks: tuple[Landmark, ...] = ()
    distance_m: float | None = None
    distance_of: str | None = None
    direction: str | None = None

    def to_dict(self) -> dict[str, Any]:
        """All keys of the labelled files; those that this grammar never fills are empty."""
        return {
            "command": self.command,
            "status": "ok" if self.action else "reject",
            "action": self.action,
            "action_alt": [],
            "actions": [self.action] if self.action else [],
            "direction": self.direction,
            "goal_side": self.goal_side,
            "relation": self.relation,
            "relation_alt": [],
            "landmark": "referent" if self.referent else "secondary" if self.landmarks else None,
            "referent": self.referent.to_dict() if self.referent else None,
            "secondary": [landmark.to_dict() for landmark in self.landmarks],
            "trigger": None,
            "distance_m": self.distance_m,
            "distance_of": self.distance_of,
            "excluded": [],
            "note": None,
        }
