"""Accuracy of the parser on labelled commands as people type and speak them.

    python -m benchmarks.grounding_noise FILE [FILE ...] [--kinds one_typo,fillers] [--repeats 3] [--show 20] [--json]

Each FILE contains labelled commands (JSONL). Every command that is read right is perturbed and read again; the table
gives the shares of readings that are

- right: still right, by the core fields of the labelled files;
- other: wrong, but another reading of the same sentence is right;
- misread: a command that is wrong;
- refused: no command.

A typo: a random word of three letters or more gets a letter inserted, deleted, replaced, swapped with its neighbour,
or replaced by a neighbouring key. Vocatives, wake words, fillers and thanks come from lists in two halves; words of
the half "unseen" were not looked at when the lexicon was written.
"""

from __future__ import annotations

import argparse
import json
import random
import re
import string
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from appocc.errors import AppoccError
from grounding.language import parse_all
from grounding.language.evaluation import read_labelled_commands, score_command

OUTCOMES = ("right", "other", "misread", "refused")
WORD = re.compile(r"[A-Za-z]{3,}")
KEYS = ("qwertyuiop", "asdfghjkl", "zxcvbnm")
# Each list: words that the lexicon may hold, words that it does not.
VOCATIVES = (
    ("mate", "pal", "buddy", "sir", "dude", "bro", "my friend", "man", "driver", "boss", "dear", "honey"),
    (
        "chum",
        "captain",
        "skipper",
        "champ",
        "squire",
        "old chap",
        "sweetheart",
        "babe",
        "amigo",
        "Jeeves",
        "Kevin",
        "chief",
    ),
)
WAKE_WORDS = (
    ("hey car", "okay car", "ok computer", "hello car", "hey autopilot", "yo car", "hi there"),
    ("okay appo", "hey appo", "hey jarvis", "alexa", "ok vera", "hello buggy", "hey you", "wakey wakey car"),
)
FILLERS = (
    ("um", "uh", "er", "you know", "well", "hmm", "oh"),
    ("erm", "ehm", "uhh", "umm", "mmm", "eh", "like I said", "let's see"),
)
THANKS = (
    ("please", "thanks", "thank you", "cheers", "pls", "thanks a lot"),
    ("ta", "please and thank you", "thx", "much appreciated", "many thanks", "thanks mate", "cheers pal", "tysm"),
)
HOMOPHONES = (
    *(
        ("buy", "by"),
        ("bye", "by"),
        ("read", "red"),
        ("write", "right"),
        ("rite", "right"),
        ("two", "to"),
        ("too", "to"),
    ),
    *(
        ("four", "for"),
        ("weight", "wait"),
        ("break", "brake"),
        ("there", "their"),
        ("rode", "road"),
        ("blew", "blue"),
    ),
    *(("grean", "green"), ("wight", "white"), ("past", "passed"), ("tern", "turn"), ("bee hind", "behind")),
    *(
        ("bus's", "buses"),
        ("vans", "van's"),
        ("lain", "lane"),
        ("sighed", "side"),
        ("inn", "in"),
        ("strait", "straight"),
    ),
    *(("buss", "bus"), ("won", "one"), ("threw", "through"), ("knot", "not"), ("hour", "our"), ("wear", "where")),
    *(("in fronts of", "in front of"), ("necks to", "next to"), ("tern", "turn")),
    *(("meters", "metres"), ("sum", "some")),
)
DIALECTS = (
    *(
        ("gray", "grey"),
        ("truck", "lorry"),
        ("parking lot", "car park"),
        ("intersection", "junction"),
        ("meter", "metre"),
    ),
    *(
        ("meters", "metres"),
        ("sidewalk", "pavement"),
        ("curb", "kerb"),
        ("crosswalk", "zebra crossing"),
        ("cab", "taxi"),
    ),
    *(
        ("highway", "motorway"),
        ("gas station", "petrol station"),
        ("traffic light", "traffic lights"),
        ("trash", "rubbish"),
    ),
    *(("toward", "towards"), ("around", "round"), ("neighbor", "neighbour"), ("center", "centre"), ("pickup", "ute")),
    *(("station wagon", "estate"), ("sedan", "saloon"), ("semi", "artic"), ("make a left", "take a left")),
    *(("trailer", "caravan"), ("motorcycle", "motorbike"), ("while", "whilst")),
)
# A perturbation: the command and a source of chance -> the perturbed command, None if it does not apply.
Perturbation = Callable[[str, random.Random], str | None]


def mistyped(word: str, chance: random.Random) -> str:
    """Return a word with one typing error."""
    while True:
        i, letter = chance.randrange(len(word)), chance.choice(string.ascii_lowercase)
        kind = chance.choice(("insert", "delete", "replace", "swap", "key"))
        if kind == "insert":
            made = word[:i] + letter + word[i:]
        elif kind == "delete":
            made = word[:i] + word[i + 1 :]
        elif kind == "swap":
            made = word[:i] + word[i + 1 : i + 2] + word[i] + word[i + 2 :]
        else:
            made = word[:i] + (neighbour_key(word[i], chance) if kind == "key" else letter) + word[i + 1 :]
        if made.lower() != word.lower():
            return made


def neighbour_key(letter: str, chance: random.Random) -> str:
    """Return a letter beside one on the keyboard, in its row or the rows above and below."""
    row, column = next((r, keys.index(letter.lower())) for r, keys in enumerate(KEYS) if letter.lower() in keys)
    near = [(row, column - 1), (row, column + 1), (row - 1, column), (row - 1, column + 1), (row + 1, column - 1)]
    near.append((row + 1, column))
    return chance.choice([KEYS[r][c] for r, c in near if 0 <= r < len(KEYS) and 0 <= c < len(KEYS[r])])


def typos(count: int) -> Perturbation:
    """Return the perturbation that mistypes some words."""

    def perturb(text: str, chance: random.Random) -> str | None:
        words = list(WORD.finditer(text))
        for match in sorted(chance.sample(words, min(count, len(words))), key=lambda one: -one.start()):
            text = text[: match.start()] + mistyped(match.group(), chance) + text[match.end() :]
        return text if len(words) >= count else None

    return perturb


def before(phrases: Sequence[str]) -> Perturbation:
    """Return the perturbation that begins with a phrase, with or without a comma."""
    return lambda text, chance: f"{chance.choice(phrases)}{chance.choice((',', ''))} {text}"


def behind(phrases: Sequence[str]) -> Perturbation:
    """Return the perturbation that ends with a phrase, with or without a comma."""
    return lambda text, chance: f"{text.rstrip(' .!')}{chance.choice((',', ''))} {chance.choice(phrases)}"


def around(phrases: Sequence[str]) -> Perturbation:
    """Return the perturbation that begins or ends with a phrase."""
    return lambda text, chance: chance.choice((before, behind))(phrases)(text, chance)


def within(phrases: Sequence[str]) -> Perturbation:
    """Return the perturbation that inserts one or two phrases between words, with or without commas."""

    def perturb(text: str, chance: random.Random) -> str:
        for _ in range(chance.randint(1, 2)):
            words = text.split()
            comma = chance.choice((",", ""))
            words.insert(chance.randrange(len(words)), f"{chance.choice(phrases)}{comma}")
            text = " ".join(words)
        return text

    return perturb


def doubled(text: str, chance: random.Random) -> str | None:
    """Return the text with one word twice."""
    words = text.split()
    i = chance.randrange(len(words))
    words.insert(i, words[i].strip(string.punctuation) or words[i])
    return " ".join(words)


def unpunctuated(text: str, chance: random.Random) -> str | None:
    """Return the text without any mark, apostrophes included; None if it has none."""
    bare = " ".join(re.sub(r"[,;:!?()\"]|\.(?!\d)", " ", text).replace("'", "").replace("’", "").split())
    return bare if bare != text else None


def exchanged(pairs: Sequence[tuple[str, str]]) -> Perturbation:
    """Return the perturbation that writes the first phrase of a pair wherever the second stands."""
    options: dict[str, list[str]] = {}
    for written, meant in pairs:
        options.setdefault(meant, []).append(written)
    pattern = re.compile(r"\b(" + "|".join(sorted(map(re.escape, options), key=len, reverse=True)) + r")\b")

    def perturb(text: str, chance: random.Random) -> str | None:
        made = pattern.sub(lambda match: chance.choice(options[match.group()]), text.lower())
        return made if made != text.lower() else None

    return perturb


KINDS: dict[str, Perturbation] = {
    "one_typo": typos(1),
    "two_typos": typos(2),
    "vocatives_seen": around(VOCATIVES[0]),
    "vocatives_unseen": around(VOCATIVES[1]),
    "wake_words_seen": before(WAKE_WORDS[0]),
    "wake_words_unseen": before(WAKE_WORDS[1]),
    "fillers_seen": within(FILLERS[0]),
    "fillers_unseen": within(FILLERS[1]),
    "thanks_seen": behind(THANKS[0]),
    "thanks_unseen": behind(THANKS[1]),
    "doubled_word": doubled,
    "no_punctuation": unpunctuated,
    "capitals": lambda text, chance: text.upper(),
    "homophones": exchanged(HOMOPHONES),
    "british_american": exchanged((*DIALECTS, *((b, a) for a, b in DIALECTS))),
}


@dataclass(frozen=True)
class Trial:
    """A perturbed command and how it was read.

    Attributes:
        kind: name of the perturbation.
        command: the original.
        perturbed: what was read.
        outcome: right, other, misread or refused.
        wrong: the core fields that differ, with the labelled and the read value.
    """

    kind: str
    command: str
    perturbed: str
    outcome: str
    wrong: tuple[tuple[str, Any, Any], ...]


def run_trial(label: dict[str, Any], kind: str, perturbed: str) -> Trial:
    """Read a perturbed command and compare it with the label of the original."""
    readings = parse_all(perturbed)
    scored = [score_command(label, one.query.to_dict()) for one in readings]
    if scored[0].core_correct:
        outcome = "right"
    elif any(one.core_correct for one in scored[1:]):
        outcome = "other"
    else:
        outcome = "misread" if readings[0].query.action else "refused"
    return Trial(kind, label["command"], perturbed, outcome, tuple(scored[0].errors()))


def run_trials(labels: Sequence[dict[str, Any]], kinds: Sequence[str], repeats: int, seed: int) -> list[Trial]:
    """Return the trials of all commands that are read right without perturbation."""
    trials = []
    for number, label in enumerate(labels):
        if not score_command(label, parse_all(label["command"])[0].query.to_dict()).core_correct:
            continue
        for kind in kinds:
            for repeat in range(repeats):
                perturbed = KINDS[kind](label["command"], random.Random(f"{seed}:{repeat}:{number}:{kind}"))
                if perturbed is not None:
                    trials.append(run_trial(label, kind, perturbed))
    return trials


def table(trials: Sequence[Trial]) -> Table:
    """Return the shares of the outcomes, one line for each perturbation."""
    made = Table("perturbation", "sentences", *OUTCOMES)
    for kind in dict.fromkeys(trial.kind for trial in trials):
        counts = Counter(trial.outcome for trial in trials if trial.kind == kind)
        total = sum(counts.values())
        made.add_row(kind, str(total), *(f"{100 * counts[name] / total:.1f} %" for name in OUTCOMES))
    return made


def main(arguments: Sequence[str] | None = None) -> None:
    """Parse arguments, run the trials, print a table or JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", type=Path, nargs="+")
    parser.add_argument("--kinds", default=",".join(KINDS), help="perturbations, with commas")
    parser.add_argument("--repeats", type=int, default=1, help="perturbed variants of each command")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--show", type=int, default=0, help="wrong readings to print for each perturbation")
    parser.add_argument("--json", action="store_true", help="print JSON")
    options = parser.parse_args(arguments)
    kinds = options.kinds.split(",")
    if unknown := [kind for kind in kinds if kind not in KINDS]:
        parser.exit(2, f"error: expected --kinds out of {', '.join(KINDS)}, got {unknown[0]}\n")
    console = Console(width=150)
    for path in options.files:
        try:
            trials = run_trials(read_labelled_commands(path), kinds, options.repeats, options.seed)
        except AppoccError as error:
            parser.exit(error.exit_code, f"error: {error}\n")
        if options.json:
            counts = {kind: Counter(one.outcome for one in trials if one.kind == kind) for kind in kinds}
            print(json.dumps({"file": str(path), "outcomes": counts}))
            continue
        console.print(table(trials), highlight=False)
        for kind in kinds:
            for one in [one for one in trials if one.kind == kind and one.outcome != "right"][: options.show]:
                wrong = "; ".join(f"{name} {read} for {label}" for name, label, read in one.wrong[:4])
                console.print(f"{kind} {one.outcome}: {one.perturbed!r} ({wrong})", highlight=False, markup=False)


if __name__ == "__main__":
    main()
