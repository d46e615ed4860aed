"""Train the reader network and the rule by which it revises the grammar, from the project's own sentences.

python -m benchmarks.train_reader [--out FILE] [--work FOLDER] [--folds 3] [--steps 4500] [--workers 1]

The speakers are divided into folds; the sentences of each fold are read by a network that saw none of its speakers:
these are the figures that are printed, and the readings on which the rule is fitted. Then the network is trained on
all sentences. One thread each; the same seed gives the same weights on the same machine, with any number of workers.
The networks are kept in the work folder, and are not trained again if they are there.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from itertools import repeat
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np
import torch
from safetensors.numpy import load_file, save_file
from torch import Tensor, nn

from appocc.files import whole_file
from benchmarks.reader.examples import Example, Sentence, example_of, preferences, read_sentences
from benchmarks.reader.network import TorchReader, batch_of, export_weights
from benchmarks.reader.rule import Case, fit_rule
from benchmarks.reader.variants import Variants
from grounding.language.evaluation import CORE_FIELDS, ScoredCommand, score_command
from grounding.language.parser import parse
from grounding.language.reader.fields import CHOICES
from grounding.language.reader.network import Numbers, ReaderNetwork
from grounding.language.reader.reader import WEIGHTS_PATH
from grounding.language.reader.revision import query_of, revise
from grounding.language.revised_readings import evidence_of
from grounding.language.syntax.tokenizer import normalise, tokenise

SEED, BATCH, RATE = 0, 32, 3e-3
SIZES: dict[str, Any] = {"size": 64, "hidden": 64, "dropout": 0.3, "feature_dropout": 0.15}
VARIANTS, VARIANT_WEIGHT = 4, 0.35
# Longest command, in characters, that another one takes back.
_SHORT = 70
_FIELD_WEIGHTS = {"status": 2.0, "direction": 0.7, "goal_side": 0.5, "landmark": 0.5, "trigger": 0.5, "act": 2.0}


def draw_variants(sentences: Sequence[Sentence]) -> list[Sentence]:
    """Return variants of all sentences; the commands that are taken back in them are no stranger's."""
    own = [one.label for one in sentences if one.label["status"] == "ok" and not one.is_stranger]
    variants = Variants([one for one in own if len(one["command"]) < _SHORT], SEED)
    drawn = ((one, variants.draw(one.label)) for one in sentences for _ in range(VARIANTS))
    return [Sentence(label, one.speaker, VARIANT_WEIGHT * one.weight) for one, label in drawn if label is not None]


def train_once(path: Path, examples: Sequence[Example], weights: Sequence[float], steps: int) -> None:
    """Write a network trained on examples that are drawn by their weights, unless the file is there."""
    if not path.exists():
        torch.manual_seed(SEED)
        network = TorchReader(CHOICES, **SIZES)
        train(network, examples, np.array(weights), steps)
        trained = export_weights(network)
        with whole_file(path) as temporary:
            save_file(trained, temporary)


def train(
    network: TorchReader, examples: Sequence[Example], weights: Numbers, steps: int, rate: float = RATE
) -> None:
    """Train a network on examples that are drawn by their weights."""
    optimiser = torch.optim.AdamW(network.parameters(), rate, weight_decay=1e-4)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, rate, total_steps=steps, pct_start=0.1)
    drawn = np.random.default_rng(SEED).choice(len(examples), (steps, BATCH), p=weights / weights.sum())
    for step, numbers in enumerate(drawn, start=1):
        chosen = [examples[i] for i in numbers]
        loss = loss_of(network(batch_of([(one.rows, one.facts) for one in chosen])), chosen)
        optimiser.zero_grad()
        torch.autograd.backward(loss)
        nn.utils.clip_grad_norm_(network.parameters(), 1.0)
        optimiser.step()
        schedule.step()
        if step % 500 == 0:
            print(f"  step {step} of {steps}, loss {loss.item():.2f}", flush=True)


def loss_of(found: dict[str, Tensor], examples: Sequence[Example]) -> Tensor:
    """Return the mean loss of a batch: minus the log probability of all right values together, of each field."""
    total = torch.zeros(())
    for field, scores in found.items():
        if field == "qualifier":
            wanted, counts = (torch.from_numpy(np.stack([one.qualifiers[i] for one in examples])) for i in (0, 1))
            total = (
                total
                + (nn.functional.binary_cross_entropy_with_logits(scores, wanted, reduction="none") * counts).sum()
            )
            continue
        added, trained = preferences(examples, field, scores.shape[1])
        total = total - _FIELD_WEIGHTS.get(field, 1.0) * (torch.logsumexp(scores + added, 1) * trained).sum()
    return total / len(examples)


def cases_of(network: ReaderNetwork, sentences: Sequence[Sentence]) -> list[Case]:
    """Return the readings of sentences by the grammar and by a network."""
    cases = []
    for one in sentences:
        text = one.label["command"]
        reading = parse(text, revised=False)
        prediction = network.predict(tokenise(normalise(text)))
        cases.append(Case(one.label, reading.query, evidence_of(reading), prediction))
    return cases


def report(name: str, cases: Sequence[Case], rule: dict[str, Numbers]) -> None:
    """Print the shares of sentences that are read right: by the grammar, by the network, and by both."""
    ways = {
        "grammar": [one.query for one in cases],
        "network": [query_of(one.label["command"], one.prediction) for one in cases],
        "both": [revise(one.query, one.evidence, one.prediction, rule).query for one in cases],
    }
    for way, queries in ways.items():
        pairs = zip(cases, queries, strict=True)
        scores = [score_command(one.label, query.to_dict()) for one, query in pairs]
        print(f"{name}, {len(cases)} sentences, {way}: {_figures(scores)}", flush=True)


def _figures(scores: Sequence[ScoredCommand]) -> str:
    core = 100 * np.mean([one.core_correct for one in scores])
    shares = {field: 100 * np.mean([one.correct[field] for one in scores]) for field in CORE_FIELDS}
    status = [(one.label["status"] == "ok", one.correct["status"]) for one in scores]
    wrong = {kind: 100 * np.mean([not right for ok, right in status if ok is kind]) for kind in (True, False)}
    fields = ", ".join(f"{field} {share:.1f}" for field, share in shares.items())
    return f"core {core:.1f} % ({fields}); rejected {wrong[True]:.1f}, accepted {wrong[False]:.1f} %"


def fold_of(speaker: str, folds: int) -> int:
    """Return the fold of a stranger."""
    return crc32(speaker.removeprefix("stranger ").encode()) % folds


def main() -> None:
    """Train, report and write the weights."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=WEIGHTS_PATH)
    parser.add_argument("--work", type=Path, default=Path("runs/reader"))
    parser.add_argument("--folds", type=int, default=3)
    parser.add_argument("--steps", type=int, default=4500)
    parser.add_argument("--workers", type=int, default=1)
    asked = parser.parse_args()
    sentences = read_sentences()
    held = [one for one in sentences if one.is_stranger]
    folds = [[one for one in held if fold_of(one.speaker, asked.folds) == fold] for fold in range(asked.folds)]
    speakers = [{one.speaker for one in fold} for fold in folds]
    learnt = [*sentences, *draw_variants(sentences)]
    paths = [asked.work / f"{name}.safetensors" for name in ("all", *range(1, asked.folds + 1))]
    with ProcessPoolExecutor(asked.workers, initializer=torch.set_num_threads, initargs=(1,)) as pool:
        examples = list(pool.map(example_of, [one.label for one in learnt], chunksize=100))
        pairs = [(example, one) for example, one in zip(examples, learnt, strict=True) if example is not None]
        parts = [[pair for pair in pairs if pair[1].speaker not in out] for out in (set(), *speakers)]
        drawn = [[[pair[0] for pair in part], [pair[1].weight for pair in part]] for part in parts]
        list(pool.map(train_once, paths, *zip(*drawn, strict=True), repeat(asked.steps)))
    networks = [ReaderNetwork(load_file(path)) for path in paths[1:]]
    cases = [cases_of(one, fold) for one, fold in zip(networks, folds, strict=True)]
    for fold, own in enumerate(cases, start=1):
        others = [case for other in cases if other is not own for case in other]
        report(f"held-out speakers, fold {fold}", own, fit_rule(others))
    rule = fit_rule([case for own in cases for case in own])
    with whole_file(asked.out) as path:
        save_file(load_file(paths[0]) | {f"rule.{name}": value for name, value in rule.items()}, path)
    print(f"{asked.out}: {asked.out.stat().st_size} bytes")


if __name__ == "__main__":
    main()
