"""Training of reader networks."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from itertools import compress
from pathlib import Path
from typing import Any, TypeVar
from zlib import crc32

import numpy as np
import torch
from safetensors.numpy import load_file, save_file
from torch import Tensor, nn

from appocc.files import whole_file
from benchmarks.reader.examples import Example, Sentence, preferences
from benchmarks.reader.network import TorchReader, batch_of, export_weights, stacked
from grounding.language.reader.network import Numbers

CaseT = TypeVar("CaseT")
RuleT = TypeVar("RuleT")
# Networks of an ensemble, each with its own seed.
SEED, MEMBERS, BATCH = 0, 2, 128
# Batches whose sentences are sorted by length, so that a batch has little padding.
_SORTED = 16
# Parts of the unseen speakers: a rule is judged on one that it was not fitted on.
_PARTS = 3
# Numbers a word, states a direction, and shares of dropped states, features, and words.
SIZES: dict[str, Any] = {"size": 64, "hidden": 128, "dropout": 0.3, "feature_dropout": 0.15, "word_dropout": 0.1}
_FIELD_WEIGHTS = {"status": 2.0, "direction": 0.7, "goal_side": 0.5, "landmark": 0.5, "trigger": 0.5, "act": 2.0}


@dataclass(frozen=True)
class Training:
    """How the networks are trained.

    Attributes:
        make: makes a new network, of the given number in its ensemble.
        example_of: makes an example of a label; None for one without words.
        rate: largest learning rate.
        steps: steps of each training.
        workers: trainings at a time, with one thread each.
        work: folder of the networks; those that are there are not trained again.
    """

    make: Callable[[int], TorchReader]
    example_of: Callable[[dict[str, Any]], Example | None]
    rate: float
    steps: int
    workers: int
    work: Path

    def run(self, learnt: Sequence[Sentence]) -> dict[str, Numbers]:
        """Return the weights of an ensemble."""
        with ProcessPoolExecutor(self.workers, initializer=torch.set_num_threads, initargs=(1,)) as pool:
            examples = list(pool.map(self.example_of, [one.label for one in learnt], chunksize=100))
            pairs = [
                (example, one.weight) for example, one in zip(examples, learnt, strict=True) if example is not None
            ]
            paths = [self.work / f"{member}.safetensors" for member in range(MEMBERS)]
            list(pool.map(partial(self._train_member, pairs), range(MEMBERS), paths))
        return stacked([load_file(path) for path in paths])

    def _train_member(self, pairs: Sequence[tuple[Example, float]], member: int, path: Path) -> None:
        """Write the network of one member, trained on (example, weight), if it is not there."""
        if path.exists():
            return
        torch.manual_seed(SEED + member)
        network = self.make(member)
        examples, weights = zip(*pairs, strict=True)
        train(network, examples, np.array(weights), steps=self.steps, rate=self.rate, seed=SEED + member)
        with whole_file(path) as temporary:
            save_file(export_weights(network), temporary)


def train(
    network: TorchReader, examples: Sequence[Example], weights: Numbers, steps: int, rate: float, seed: int
) -> None:
    """Train a network on examples that are drawn by their weights."""
    optimiser = torch.optim.AdamW(network.parameters(), rate, weight_decay=1e-4)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, rate, total_steps=steps, pct_start=0.1)
    for step, chosen in enumerate(_batches(examples, weights, steps, seed), start=1):
        loss = loss_of(network(batch_of([(one.rows, one.facts) for one in chosen])), chosen)
        optimiser.zero_grad()
        torch.autograd.backward(loss)
        nn.utils.clip_grad_norm_(network.parameters(), 1.0)
        optimiser.step()
        schedule.step()
        if step % 500 == 0:
            print(f"  step {step} of {steps}, loss {loss.item():.2f}", flush=True)


def _batches(examples: Sequence[Example], weights: Numbers, steps: int, seed: int) -> Iterator[list[Example]]:
    """Yield batches of examples that are drawn by their weights, each of sentences of similar length."""
    generator = np.random.default_rng(seed)
    lengths = np.array([len(one.rows) for one in examples])
    for begun in range(0, steps, _SORTED):
        count = min(_SORTED, steps - begun)
        drawn = generator.choice(len(examples), count * BATCH, p=weights / weights.sum())
        batches = drawn[np.argsort(lengths[drawn], kind="stable")].reshape(count, BATCH)
        for numbers in generator.permutation(batches):
            yield [examples[i] for i in numbers]


def loss_of(found: dict[str, Tensor], examples: Sequence[Example]) -> Tensor:
    """Return the mean loss of a batch: minus the log probability of all right values together, of each field."""
    total = torch.zeros(())
    for field, scores in found.items():
        if field == "tag":
            wanted, counts = (torch.from_numpy(np.stack([one.tags[i] for one in examples])) for i in (0, 1))
            total = (
                total
                + (nn.functional.binary_cross_entropy_with_logits(scores, wanted, reduction="none") * counts).sum()
            )
            continue
        added, trained = preferences(examples, field, scores.shape[1])
        total = total - _FIELD_WEIGHTS.get(field, 1.0) * (torch.logsumexp(scores + added, 1) * trained).sum()
    return total / len(examples)


def cross_fit(
    cases: Sequence[CaseT], unseen: Sequence[Sentence], fit: Callable[[Sequence[CaseT]], RuleT]
) -> Iterator[tuple[CaseT, RuleT]]:
    """Yield each case with the rule that is fitted on the cases of the other speakers.

    Args:
        cases: a case of each sentence.
        unseen: the sentences.
        fit: fits a rule on cases.
    """
    parts = [crc32(one.speaker.encode()) % _PARTS for one in unseen]
    for part in range(_PARTS):
        held = [own == part for own in parts]
        rule = fit([case for case, is_held in zip(cases, held, strict=True) if not is_held])
        yield from ((case, rule) for case in compress(cases, held))


def arguments(doc: str, out: Path, work: Path, steps: int) -> argparse.Namespace:
    """Return the arguments of a training: out, work, steps, workers."""
    parser = argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=out)
    parser.add_argument("--work", type=Path, default=work)
    parser.add_argument("--steps", type=int, default=steps)
    parser.add_argument("--workers", type=int, default=2)
    return parser.parse_args()


def write_reader(path: Path, weights: Mapping[str, Numbers], rule: Mapping[str, Numbers]) -> None:
    """Write a weights file: the network's and the rule's."""
    with whole_file(path) as temporary:
        save_file({**weights, **{f"rule.{name}": value for name, value in rule.items()}}, temporary)
    print(f"{path}: {path.stat().st_size} bytes")
