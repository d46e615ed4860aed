"""Labelled turns of conversations, and whole commands among them, as examples for the network of turns."""

from __future__ import annotations

import json
import random
from functools import cache
from pathlib import Path
from typing import Any, get_args
from zlib import crc32

from appocc.errors import DataError
from appocc.files import read_text
from benchmarks.reader.examples import Example, Sentence, colour_words, read_sentences, tags_of
from grounding.dialogue.turns import ACTS_OF_KINDS
from grounding.language.parser import parse
from grounding.language.reader.features import WordFacts
from grounding.language.reader.fields import ACTS, NONE, NOUNS, QUALIFIERS, TURN_CHOICES
from grounding.language.reader.turns import State, turn_rows
from grounding.language.replies import Reply, read_reply, reply_patterns
from grounding.language.syntax.tokenizer import normalise, tokenise
from grounding.query import Query

TURNS = Path(__file__).parent / "sentences" / "turns.jsonl"
UNSEEN = Path(__file__).parent / "sentences" / "unseen_turns.jsonl"
PHRASE_BOOK = Path(__file__).parent / "sentences" / "phrase_book.jsonl"
STATES: tuple[State, ...] = get_args(State)
# Phrases of each pattern of replies.
_PHRASES = 3
_LISTS = ("act_alt", "action_alt", "relation_alt", "secondary", "excluded")
# How often a turn, one of the phrase book, a whole command, another sentence, and a phrase of the patterns are drawn.
_TURN, _BOOK, _WHOLE, _REJECTED, _PATTERN = 2.0, 1.0, 0.15, 0.05, 0.25
# Acts that may name a vehicle, a place, and an action: where one names none, that is learnt too.
_OF_VEHICLES = ("describe", "place", "command", "then", "count", "seek")
_OF_PLACES = ("describe", "place", "command", "then")
_OF_ACTIONS = ("command", "then", "drop")
# What a sentence that is no command may do besides.
_OTHER_ACTS = ("heading", "why", "about", "seek", "count", "room", "seen")
# Heads that name no class.
_PRONOUNS = ("one", "ones", "un", "yin", "1", "this", "that", "it", "him", "her", "them", "he", "she", "fella", "guy")
_SIDES = {"left": "left_side", "right": "right_side"}


def read_turns() -> list[Sentence]:
    """Return the labelled turns of strangers, each with its act and state in the label.

    Raises:
        DataError: if a line is invalid.
    """
    return [Sentence(label, f"stranger {label['speaker']}", _TURN) for label in _read_labels(TURNS)]


def read_unseen_turns() -> list[Sentence]:
    """Return the turns of authors of whom nothing is learnt.

    Raises:
        DataError: if a line is invalid.
    """
    return [Sentence(label, label["speaker"], 1.0) for label in _read_labels(UNSEEN)]


def read_phrase_book() -> list[Sentence]:
    """Return the phrase book: each act in many words, sorted by act when it was written.

    Raises:
        DataError: if a line is invalid.
    """
    return [Sentence(label, "phrase book", _BOOK) for label in _read_labels(PHRASE_BOOK)]


def _read_labels(path: Path) -> list[dict[str, Any]]:
    found = []
    for number, line in enumerate(read_text(path, 10_000_000).splitlines(), start=1):
        try:
            found.append(_label(json.loads(line)))
        except (ValueError, KeyError, TypeError) as error:
            raise DataError(f"{path}: line {number}: {type(error).__name__}: {error}") from error
    return found


def _label(record: dict[str, Any]) -> dict[str, Any]:
    fields = (*TURN_CHOICES, "referent", "distance_m")
    label = dict.fromkeys(fields) | {name: [] for name in _LISTS} | record | {"command": record["say"]}
    if label["act"] not in ACTS or label["state"] not in STATES:
        raise ValueError(f"expected a known act and state, got '{label['act']}', '{label['state']}'")
    referent = label["referent"]
    if referent is not None:
        empty: dict[str, Any] = {"noun": "vehicle", "noun_alt": [], "head": "", "colour": None}
        referent = empty | {"qualifiers": [], "qualifiers_optional": []} | referent
        named = [_SIDES.get(one, one) for one in referent["qualifiers"]]
        label["referent"] = referent | {"qualifiers": [one for one in named if one in QUALIFIERS]}
    return label


def read_whole_commands() -> list[Sentence]:
    """Return the whole sentences of the other network, as turns."""
    found = []
    for one in read_sentences():
        state = STATES[crc32(one.label["command"].encode()) % len(STATES)]
        ok = one.label["status"] == "ok"
        acts = {"act": "command", "act_alt": []} if ok else {"act": "remark", "act_alt": list(_OTHER_ACTS)}
        label = one.label | acts | {"state": state, "shift": None}
        found.append(Sentence(label, f"whole {one.speaker}", one.weight * (_WHOLE if ok else _REJECTED)))
    return found


def read_patterns(seed: int) -> list[Sentence]:
    """Return phrases of the patterns of replies, as turns."""
    drawn, found = random.Random(seed), []
    for pattern in reply_patterns():
        kind = pattern.entry.value
        act = ACTS_OF_KINDS.get(kind, kind)
        if act not in ACTS or act in ("seek", "count", "room"):
            continue
        for _ in range(_PHRASES):
            words = [
                drawn.choice([one for each in choices.values() for one in each])
                for choices, optional in pattern.parts()
                if not optional or drawn.random() < 0.5
            ]
            label = dict.fromkeys((*TURN_CHOICES, "referent")) | {name: [] for name in _LISTS}
            label |= {"act": act, "shift": kind if act == "shift" else None, "state": drawn.choice(STATES)}
            label |= {"command": " ".join(word for phrase in words for word in phrase), "shown": drawn.random() < 0.3}
            found.append(Sentence(label, "patterns", _PATTERN))
    return found


@cache
def command_before(said: str) -> Query | None:
    """Return the query of what the passenger said before; None where it is not known."""
    return parse(said, revised=False).query if said else None


def turn_example(label: dict[str, Any]) -> Example | None:
    """Return the example of a labelled turn, None for one without words."""
    text = label["command"]
    tokens = tokenise(normalise(text))[:79]
    if not tokens:
        return None
    # What the patterns make of their own phrases is mostly hidden, so that the words are learnt.
    reply = read_reply(text) if label.get("shown", True) else Reply(rest=text)
    rows, facts = turn_rows(tokens, label["state"], reply, command_before(label.get("said", "")))
    right = {"act": [ACTS.index(one) for one in (label["act"], *label["act_alt"]) if one in ACTS]}
    acts = {label["act"], *label["act_alt"]}
    if "shift" in acts and label["shift"]:
        right["shift"] = [TURN_CHOICES["shift"].index(label["shift"])]
    whole = label.get("fields_known", True)  # of some turns only the act is labelled
    trained = {
        **dict.fromkeys(("relation", "goal_side"), label["act"] in _OF_PLACES or bool(label["relation"])),
        **dict.fromkeys(("action", "direction"), label["act"] in _OF_ACTIONS and bool(label["action"])),
    }
    for field in (one for one, is_trained in trained.items() if is_trained and whole):
        named = [one or NONE for one in (label[field], *label.get(f"{field}_alt", ()))]
        right[field] = [TURN_CHOICES[field].index(one) for one in named if one in TURN_CHOICES[field]]
    referent = label["referent"]
    names = (label["act"] in _OF_VEHICLES and whole) or referent is not None
    if names:
        right["noun"] = [NOUNS.index(one) for one in _nouns(referent, facts)]
        right["colour"] = colour_words((referent or {}).get("colour"), facts)
    return Example(rows, facts, right, tags_of(referent, names))


def _nouns(referent: dict[str, Any] | None, facts: list[WordFacts]) -> list[str]:
    """Return the classes that the words of a turn may name: none if the vehicle is only "one" or "it"."""
    if referent is None:
        return [NONE]
    nouns = [one for one in (referent["noun"], *referent.get("noun_alt", ())) if one in NOUNS]
    head = str(referent.get("head") or "").casefold()
    named = any(fact.noun in nouns for fact in facts)
    guessed = any(head and head in fact.text for fact in facts) and head not in _PRONOUNS
    return nouns if named or guessed else [NONE]
