"""Train the network that reads the turns of a conversation.

python -m benchmarks.train_turns [--out FILE] [--work FOLDER] [--steps 8000] [--workers 2]

It begins with the weights of the reader of whole commands. The turns of two authors are not learnt from
(`sentences/unseen_turns.jsonl`): how they are read is printed, and on their readings the vote with the patterns of
replies is fitted; its own figure is that of votes fitted on the other two thirds of their speakers. The same seed
gives the same weights on the same machine. Networks that are in the work folder are not trained again.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from safetensors.numpy import load_file
from torch import Tensor

from benchmarks.reader.examples import Sentence
from benchmarks.reader.network import TorchReader, start_from
from benchmarks.reader.rule import as_tensor, minimise
from benchmarks.reader.training import SEED, SIZES, Training, arguments, cross_fit, write_reader
from benchmarks.reader.turns import (
    command_before,
    read_patterns,
    read_phrase_book,
    read_turns,
    read_unseen_turns,
    read_whole_commands,
    turn_example,
)
from benchmarks.reader.variants import Variants
from benchmarks.train_reader import VARIANT_WEIGHT
from grounding.dialogue.turns import Turn, own_act, vote_on_act
from grounding.language.parser import parse
from grounding.language.reader.fields import ACTS, CHOICES, TURN_CHOICES
from grounding.language.reader.network import Numbers, Prediction, ReaderNetwork
from grounding.language.reader.reader import WEIGHTS_PATH
from grounding.language.reader.turns import TURNS_PATH
from grounding.language.replies import read_reply
from grounding.query import Referent

RATE, VARIANTS = 3e-3, 3
TURN_SIZES = SIZES | {"dropout": 0.4, "feature_dropout": 0.25}


def new_network(member: int) -> TorchReader:
    """Return a network that begins with what a member of the reader of whole commands has learnt."""
    network = TorchReader(TURN_CHOICES, **TURN_SIZES)
    weights = {name: array[member] for name, array in load_file(WEIGHTS_PATH).items() if not name.startswith("rule.")}
    start_from(network, weights, tuple(CHOICES))
    return network


def learnt_sentences() -> list[Sentence]:
    """Return what is learnt: turns with variants, the phrase book, whole commands, phrases of the patterns."""
    turns, variants = read_turns(), Variants([], SEED)
    drawn = ((one, variants.draw(one.label)) for one in turns for _ in range(VARIANTS))
    varied = [Sentence(label, one.speaker, VARIANT_WEIGHT * one.weight) for one, label in drawn if label]
    return [*turns, *varied, *read_phrase_book(), *read_whole_commands(), *read_patterns(SEED)]


@dataclass(frozen=True, eq=False)
class Case:
    """A labelled turn, what the network predicts, and the act by the grammar with the index of its vote."""

    label: dict[str, Any]
    prediction: Prediction
    own: tuple[str, int]


def cases_of(network: ReaderNetwork, turns: Sequence[Sentence]) -> list[Case]:
    """Return the readings of turns by a network and by the grammar."""
    cases = []
    for one in turns:
        example = turn_example(one.label)
        if example is not None:
            prediction = network.predict_rows(example.rows, example.facts)
            reply = read_reply(one.label["command"])
            before = command_before(one.label.get("said", ""))
            spoken_of = before.referent if before is not None else None
            reading = parse(reply.rest or one.label["command"], antecedent=spoken_of, revised=False)
            cases.append(Case(one.label, prediction, own_act(reply, reading)))
    return cases


def fit_rule(cases: Sequence[Case]) -> Numbers:
    """Return the weights (3,) of `grounding.dialogue.turns.vote_on_act` that make the right acts likeliest."""
    logs = as_tensor([[math.log(one.prediction.choices["act"][act] + 1e-4) for act in ACTS] for one in cases])
    own = as_tensor([[[act == one.own[0] and one.own[1] == i for i in (1, 2)] for act in ACTS] for one in cases])
    right = as_tensor([[act in (one.label["act"], *one.label["act_alt"]) for act in ACTS] for one in cases])

    def loss(weights: Tensor) -> Tensor:
        scores = weights[0] * logs + own @ weights[1:]
        kept = torch.logsumexp(scores - 1e4 * (1 - right), 1) - torch.logsumexp(scores, 1)
        return -kept.sum() + 0.5 * (weights[1:] ** 2).sum()

    return minimise(loss, np.array([1.0, 1.0, 1.0]))


def report(cases: Sequence[Case], unseen: Sequence[Sentence]) -> None:
    """Print the shares of turns whose act is right, by the grammar, the network and both, and of other fields."""
    ways: dict[str, list[bool]] = {"grammar": [], "network": [], "both": []}
    fields: dict[str, list[bool]] = {"shift": [], "relation": [], "vehicle": []}
    unsure = []
    for one, rule in cross_fit(cases, unseen, fit_rule):
        shares, right = one.prediction.choices["act"], (one.label["act"], *one.label["act_alt"])
        votes = vote_on_act(shares, one.own, rule)
        best = max(votes, key=votes.__getitem__)
        for way, act in zip(ways, (one.own[0], max(shares, key=shares.__getitem__), best), strict=True):
            ways[way].append(act in right)
        unsure.append(votes[best] < 0.5)
        turn = Turn(best, votes[best], one.prediction)
        if one.label["act"] == "shift":
            fields["shift"].append(turn.best("shift") == one.label["shift"])
        if one.label["act"] == "place" and one.label["relation"]:
            fields["relation"].append(turn.best("relation") in (one.label["relation"], *one.label["relation_alt"]))
        if one.label["act"] == "describe" and (wanted := one.label["referent"]):
            found = turn.described(None) or Referent("", "")
            alike = (found.colour, {*found.qualifiers}) == (wanted["colour"], {*wanted["qualifiers"]})
            fields["vehicle"].append(alike)
    figures = [f"{way} {100 * np.mean(each):.1f} %" for way, each in (ways | fields).items()]
    share = 100 * np.mean(unsure)
    print(f"{len(cases)} turns of unseen authors: act {', '.join(figures)}; unsure {share:.1f} %", flush=True)


def main() -> None:
    """Train, report and write the weights."""
    assert __doc__
    asked = arguments(__doc__, TURNS_PATH, Path("runs/turns"), 8000)
    training = Training(new_network, turn_example, RATE, asked.steps, asked.workers, asked.work)
    weights = training.run(learnt_sentences())
    unseen = read_unseen_turns()
    cases = cases_of(ReaderNetwork(weights, TURN_CHOICES), unseen)
    report(cases, unseen)
    write_reader(asked.out, weights, {"act": fit_rule(cases)})


if __name__ == "__main__":
    main()
