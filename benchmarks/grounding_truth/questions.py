"""Sentences of the audit of places: those of labelled files in random key frames, and drawn ones."""

from __future__ import annotations

import json
import zlib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks.grounding_truth.case_generation import SUITS
from benchmarks.grounding_truth.key_frames import Town
from benchmarks.grounding_truth.places import Ask
from benchmarks.grounding_truth.sentences import command, describe


class Question(NamedTuple):
    """A sentence to ask in a key frame.

    Attributes:
        token: token of the sample.
        sentence: the command.
        ask: its action and details.
        origin: the file that it stands in, or "drawn".
        relation: as in `regions.RELATIONS`; '' where it is not known.
        instance: the vehicle meant, by instance; '' without one.
    """

    token: str
    sentence: str
    ask: Ask
    origin: str
    relation: str = ""
    instance: str = ""


def labelled(files: Sequence[Path], tokens: Sequence[str], draws: int, seed: int) -> Iterator[Question]:
    """Yield the commands of labelled files, each in some frames at random."""
    for path in files:
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines()):
            row: dict[str, Any] = json.loads(line)
            if row.get("status") == "ok":
                random = np.random.default_rng([seed, number, zlib.crc32(path.name.encode())])
                for at in random.choice(len(tokens), min(draws, len(tokens)), replace=False).tolist():
                    yield Question(tokens[at], row["command"], Ask(str(row["action"])), path.stem)


def drawn(town: Town, tokens: Sequence[str], count: int, seed: int) -> Iterator[Question]:
    """Yield commands about vehicles of key frames, as many in each: any relation, whatever is free or ahead."""
    pairs = [(relation, action) for suits in SUITS.values() for relation, action in suits if relation != "between"]
    for number, token in enumerate(tokens):
        moment = town.moment(token)
        random = np.random.default_rng([seed, 1, zlib.crc32(token.encode())])
        near = [v for v in moment.vehicles if v.visible and v.on_map]
        for _ in range(count * (number + 1) // len(tokens) - count * number // len(tokens)):
            relation, action = pairs[int(random.integers(len(pairs)))]
            if relation == "none":
                ask = Ask(action, 15.0 if action == "stop" else None, "right" if action != "stop" else None)
                yield Question(token, command(relation, ask, [], random), ask, "drawn", relation)
                continue
            for i in random.permutation(len(near))[:6].tolist():
                if said := describe(moment, near[i], False, random):
                    words = command(relation, Ask(action), [(said, near[i].body)], random)
                    yield Question(token, words, Ask(action), "drawn", relation, near[i].instance)
                    break
