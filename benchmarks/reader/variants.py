"""Variants of labelled sentences that keep their labels, or change them with the words."""

from __future__ import annotations

import copy
import json
import random
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import yaml

from benchmarks.reader.examples import rejected

Label = dict[str, Any]
_WORDS = yaml.safe_load((Path(__file__).parent / "words.yaml").read_text(encoding="utf-8"))
_NAMES = [(noun, name) for noun, names in _WORDS["names"].items() for name in names]
# A noun phrase with these words between its article and its noun is left as it is.
_NOT_PLAIN = re.compile(r"\b(of|the|that|behind|in|on|and|a|to|by|from|not|isn't|no|other)\b")
# "Right" and "left" as no side.
_NO_SIDE = re.compile(
    r"right (behind|next|in|beside|up|after|before|here|there|by|at|on|past|now)|(all|that's|you're) right|^right\b"
    r"|\bright[,.!?]|(have|has|'ve|had|just|is) left|, right|kerb|near ?side|off ?side|fast lane|slow lane",
    re.IGNORECASE,
)
_SIDE = re.compile("left|right|Left|Right|LEFT|RIGHT")
_OTHER_SIDE = {"left": "right", "Left": "Right", "LEFT": "RIGHT"}
_OTHER_SIDE |= {right: left for left, right in _OTHER_SIDE.items()}


class Variants:
    """Draw variants of sentences."""

    def __init__(self, others: Sequence[Label], seed: int) -> None:
        """Take short commands that a speaker may take back, and the seed."""
        self._others, self._random = others, random.Random(seed)
        self._kinds: tuple[Callable[[Label], Label | None], ...] = (
            *(self._address, self._reason, self._both, self._story, self._story_after, self._typo, self._typed),
            *(self._other_vehicle, self._other_vehicle, self._repair, self._repair, self._mentioned),
            *(self._mirror, self._mirror, self._taken_back, self._report, self._forbidden),
        )
        self._of_turns: tuple[Callable[[Label], Label | None], ...] = (
            *(self._address, self._reason, self._story_after, self._typo, self._typed),
            *(self._other_vehicle, self._other_vehicle, self._mirror, self._mirror),
        )

    def draw(self, label: Label) -> Label | None:
        """Return a variant of a sentence or of a turn, None if some tries gave none."""
        kinds = self._of_turns if "act" in label else self._kinds
        tries = (self._random.choice(kinds)(label) for _ in range(3))
        return next((one for one in tries if one is not None), None)

    def _pick(self, name: str) -> str:
        return str(self._random.choice(_WORDS[name]))

    def _address(self, label: Label) -> Label | None:
        text = label["command"]
        return _said(label, f"{self._pick('openings')}{self._random.choice((', ', ' ', ' '))}{_lower(text)}")

    def _reason(self, label: Label) -> Label | None:
        return _said(label, f"{_open_end(label)}{self._random.choice((', ', ' ', '. '))}{self._pick('endings')}")

    def _both(self, label: Label) -> Label | None:
        addressed = self._address(label)
        return self._reason(addressed) if addressed else None

    def _story(self, label: Label) -> Label | None:
        if (label["referent"] or {}).get("anaphora"):
            return None
        joint = self._random.choice((". ", ", ", ". So ", ". Anyway, ", " but "))
        return _said(label, f"{self._pick('stories')}{joint}{label['command']}")

    def _story_after(self, label: Label) -> Label | None:
        joint = self._random.choice((". ", ", ", " because ", " - "))
        return _said(label, f"{_open_end(label)}{joint}{self._pick('stories')}")

    def _typo(self, label: Label) -> Label | None:
        words = label["command"].split(" ")
        long = [i for i, word in enumerate(words) if len(word) > 3 and word.isalpha()]
        if not long:
            return None
        i = self._random.choice(long)
        word, at = words[i], self._random.randrange(1, len(words[i]) - 1)
        mistakes = (
            word[:at] + word[at + 1 :],
            word[:at] + word[at] + word[at:],
            word[: at - 1] + word[at] + word[at - 1] + word[at + 1 :],
        )
        words[i] = self._random.choice(mistakes)
        return _said(label, " ".join(words))

    def _typed(self, label: Label) -> Label | None:
        marks = self._random.choice((r"[,.!?;:]", "$^"))
        return _said(label, re.sub(marks, "", label["command"]).lower())

    def _other_vehicle(self, label: Label) -> Label | None:
        """Another class and colour."""
        found = _noun_phrase(label)
        if found is None:
            return None
        noun, name = self._random.choice(_NAMES)
        referent, middle = copy.deepcopy(label["referent"]), found.group(2)
        colour = self._random.choice(_WORDS["colours"])
        if referent.get("colour") and referent["colour"] in middle.lower():
            middle = re.sub(re.escape(referent["colour"]), colour, middle, flags=re.IGNORECASE)
            referent["colour"] = colour
        elif not referent.get("colour") and self._random.random() < 0.3:
            middle, referent["colour"] = f"{middle}{colour} ", colour
        referent |= {"noun": noun, "noun_alt": [], "head": name}
        plural = "s" if referent.get("number") == 2 else ""
        text = label["command"]
        changed = f"{text[: found.start()]}{found.group(1)} {middle}{name}{plural}{text[found.end() :]}"
        return {**label, "referent": referent, "command": changed}

    def _mentioned(self, label: Label) -> Label | None:
        """The vehicle is named before, or after, the command."""
        found = _noun_phrase(label)
        if found is None or label["referent"]["qualifiers"] or label["referent"].get("anaphora"):
            return None
        text, named = label["command"], found.group()
        before, after = text[: found.start()], text[found.end() :]
        if self._random.random() < 0.5:
            joint, pronoun = self._random.choice(("? ", ". ", ", ", " ")), self._random.choice(_WORDS["pronouns"])
            return _said(label, f"{self._pick('pointers')} {named}{joint}{before}{pronoun}{after}")
        end = self._random.choice((", ", " - ", ", you know, ", ", I mean "))
        return _said(label, f"{before}that one{after.rstrip('.!?')}{end}{named}")

    def _repair(self, label: Label) -> Label | None:
        """Another vehicle is taken back or ruled out."""
        found = _noun_phrase(label)
        if found is None or label["referent"].get("anaphora"):
            return None
        referent, text, named = label["referent"], label["command"], found.group()
        colour = self._random.choice([one for one in _WORDS["colours"] if one != referent.get("colour")])
        noun, name = self._random.choice(_NAMES)
        if referent.get("colour") and self._random.random() < 0.5:
            other = f"the {colour} {self._random.choice(('one', referent['head']))}"
        elif noun in (referent["noun"], *referent["noun_alt"]) or referent["noun"] == "vehicle":
            return None
        else:
            other = self._random.choice((f"the {name}", f"the {colour} {name}"))
        before, after = text[: found.start()], text[found.end() :]
        forms = (
            f"{before}{other}{self._pick('repairs')}{named}{after}",
            f"{before}{named}, not {other}{',' if after.strip() and after[0] != ',' else ''}{after}",
            f"not {other}{self._random.choice((', ', '. ', ', no, '))}{text}",
            f"{_open_end(label)}{self._pick('contrasts')}{other}",
            f"{before}not {other} but {named}{after}",
            f"{self._pick('dismissals')} {other}{self._random.choice((', ', '. '))}{text}",
        )
        return _said(label, self._random.choice(forms))

    def _mirror(self, label: Label) -> Label | None:
        """Left for right."""
        keys = ("direction", "goal_side", "relation", "relation_alt", "referent", "secondary", "excluded", "shift")
        fields = json.dumps({key: label[key] for key in keys if key in label})
        if _NO_SIDE.search(label["command"]) or not _SIDE.search(label["command"]) or not _SIDE.search(fields):
            return None
        return {**label, **json.loads(_mirrored(fields)), "command": _mirrored(label["command"])}

    def _taken_back(self, label: Label) -> Label | None:
        """Another command is taken back."""
        if not label["referent"] or label["referent"].get("anaphora") or not self._others:
            return None
        other = self._random.choice(self._others)
        return _said(label, f"{_open_end(other)}{self._pick('retractions')}{_lower(label['command'])}")

    def _report(self, label: Label) -> Label | None:
        """What somebody else did is no command."""
        first = label["command"].split(" ")[0].lower()
        if label["status"] == "reject" or first not in _WORDS["verbs"]:
            return None
        return rejected(self._pick("reports").format(_lower(_open_end(label))))

    def _forbidden(self, label: Label) -> Label | None:
        """A manoeuvre that is forbidden is not made."""
        first = label["command"].split(" ")[0].lower()
        if label["action"] not in ("overtake", "drive_past", "turn", "change_lane") or first not in _WORDS["verbs"]:
            return None
        others: Label = {"action": "other", "action_alt": ["avoid", "wait", "slow_down"], "relation": "none"}
        others |= {"relation_alt": [label["relation"]], "direction": None, "landmark": None}
        return {**label, **others, "command": f"{self._pick('prohibitions')} {_lower(label['command'])}"}


def _said(label: Label, text: str) -> Label:
    return {**label, "command": text}


def _lower(text: str) -> str:
    return text[:1].lower() + text[1:]


def _open_end(label: Label) -> str:
    return str(label["command"]).rstrip(".!?")


def _mirrored(text: str) -> str:
    return _SIDE.sub(lambda found: _OTHER_SIDE[found.group()], text)


def _noun_phrase(label: Label) -> re.Match[str] | None:
    """Return where the vehicle is named plainly: groups article and adjectives; None if it is not, or twice."""
    head = re.escape(str((label["referent"] or {}).get("head") or ""))
    text = label["command"]
    if not head or len(re.findall(rf"\b{head}\b", text, re.IGNORECASE)) != 1:
        return None
    articles = "the|that|this|a|an|yon|these|those|your|my"
    found = re.search(rf"\b({articles})\s+((?:[\w'-]+\s+){{0,3}}?){head}\b", text, re.IGNORECASE)
    return None if found is None or _NOT_PLAIN.search(found.group(2).lower()) else found
