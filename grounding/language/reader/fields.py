"""Fields: what the reader network predicts, and their values."""

from __future__ import annotations

from typing import get_args

from grounding.query import Direction, Referent
from grounding.query_schema import Noun, Qualifier
from grounding.vocabulary import Action, Relation, ShiftDirection, Trigger

NONE = "none"
NOUNS: tuple[str, ...] = (NONE, *get_args(Noun))
VEHICLES = tuple(one for one in NOUNS if one not in (NONE, "person"))
QUALIFIERS: tuple[str, ...] = get_args(Qualifier)
ACTIONS: tuple[str, ...] = get_args(Action)
# What a sentence may have several of: qualifiers of the vehicle, and commanded actions.
TAGS = (*QUALIFIERS, *ACTIONS)
# Fields with one value of a closed list each; the colour points to a word.
CHOICES: dict[str, tuple[str, ...]] = {
    "status": ("ok", "reject"),
    "action": ACTIONS,
    "relation": get_args(Relation),
    "direction": (NONE, *get_args(Direction)),
    "goal_side": (NONE, "left", "right"),
    "landmark": (NONE, "referent", "secondary"),
    "trigger": (NONE, *get_args(Trigger)),
}
# Fields about which grammar and network vote.
FIELDS = ("action", "relation", "direction", "noun", "colour")
# What a turn of a conversation does.
ACTS: tuple[str, ...] = (
    *("yes", "no", "any", "other", "neither", "number", "middle", "following", "previous"),
    *("describe", "place", "shift", "more", "less", "half", "double"),
    *("cancel", "undo", "elsewhere", "pause"),
    *("heading", "why", "repeat", "seen", "about", "count", "seek", "room"),
    *("command", "then", "drop", "remark"),
)
# The same of a turn.
TURN_CHOICES: dict[str, tuple[str, ...]] = {
    "act": ACTS,
    "shift": get_args(ShiftDirection),
    **{field: CHOICES[field] for field in ("action", "relation", "direction", "goal_side")},
}


def unlearnt_qualifiers(referent: Referent) -> tuple[str, ...]:
    """Return the qualifiers of a referent that the networks do not know: only the grammar reads them."""
    return tuple(one for one in referent.qualifiers if one not in QUALIFIERS)
