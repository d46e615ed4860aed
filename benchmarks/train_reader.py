"""Train the networks of the reader and the rule by which they revise the grammar, from the project's own sentences.

python -m benchmarks.train_reader [--out FILE] [--work FOLDER] [--steps 8000] [--workers 2]

The sentences of three authors are not learnt from (`sentences/unseen_sentences.jsonl`): how they are read is printed,
and on their readings the rule is fitted; its own figure is that of rules fitted on the other two thirds of their
speakers. One thread each; the same seed gives the same weights on the same machine, with any number of workers. The
networks are kept in the work folder, and are not trained again if they are there.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.reader.examples import Sentence, example_of, read_sentences, read_unseen_sentences
from benchmarks.reader.network import TorchReader
from benchmarks.reader.rule import Case, fit_rule
from benchmarks.reader.training import SEED, SIZES, Training, arguments, cross_fit, write_reader
from benchmarks.reader.variants import Variants
from grounding.language.evaluation import CORE_FIELDS, ScoredCommand, score_command
from grounding.language.parser import parse
from grounding.language.reader.fields import CHOICES
from grounding.language.reader.network import ReaderNetwork
from grounding.language.reader.reader import WEIGHTS_PATH
from grounding.language.reader.revision import query_of, revise
from grounding.language.revised_readings import evidence_of
from grounding.language.syntax.tokenizer import normalise, tokenise

RATE = 3e-3
VARIANTS, VARIANT_WEIGHT = 4, 0.35
# Longest command, in characters, that another one takes back.
_SHORT = 70


def draw_variants(sentences: Sequence[Sentence]) -> list[Sentence]:
    """Return variants of all sentences; the commands that are taken back in them are no stranger's."""
    own = [one.label for one in sentences if one.label["status"] == "ok" and not one.is_stranger]
    variants = Variants([one for one in own if len(one["command"]) < _SHORT], SEED)
    drawn = ((one, variants.draw(one.label)) for one in sentences for _ in range(VARIANTS))
    return [Sentence(label, one.speaker, VARIANT_WEIGHT * one.weight) for one, label in drawn if label is not None]


def cases_of(network: ReaderNetwork, sentences: Sequence[Sentence]) -> list[Case]:
    """Return the readings of sentences by the grammar and by a network."""
    cases = []
    for one in sentences:
        text = one.label["command"]
        reading = parse(text, revised=False)
        prediction = network.predict(tokenise(normalise(text)))
        cases.append(Case(one.label, reading.query, evidence_of(reading), prediction))
    return cases


def report(cases: Sequence[Case], unseen: Sequence[Sentence]) -> None:
    """Print the shares of sentences that are read right: by the grammar, the network, and the rule of others."""
    ways: dict[str, list[ScoredCommand]] = {"grammar": [], "network": [], "both": []}
    for one, rule in cross_fit(cases, unseen, fit_rule):
        both = revise(one.query, one.evidence, one.prediction, rule).query
        queries = (one.query, query_of(one.label["command"], one.prediction), both)
        for scores, query in zip(ways.values(), queries, strict=True):
            scores.append(score_command(one.label, query.to_dict()))
    for way, scores in ways.items():
        print(f"{len(cases)} sentences of unseen authors, {way}: {_figures(scores)}", flush=True)


def _figures(scores: Sequence[ScoredCommand]) -> str:
    core = 100 * np.mean([one.core_correct for one in scores])
    shares = {field: 100 * np.mean([one.correct[field] for one in scores]) for field in CORE_FIELDS}
    status = [(one.label["status"] == "ok", one.correct["status"]) for one in scores]
    wrong = {kind: 100 * np.mean([not right for ok, right in status if ok is kind]) for kind in (True, False)}
    fields = ", ".join(f"{field} {share:.1f}" for field, share in shares.items())
    return f"core {core:.1f} % ({fields}); rejected {wrong[True]:.1f}, accepted {wrong[False]:.1f} %"


def new_network(_: int) -> TorchReader:
    """Return a network that is not trained yet."""
    return TorchReader(CHOICES, **SIZES)


def main() -> None:
    """Train, report and write the weights."""
    assert __doc__
    asked = arguments(__doc__, WEIGHTS_PATH, Path("runs/reader"), 8000)
    sentences = read_sentences()
    training = Training(new_network, example_of, RATE, asked.steps, asked.workers, asked.work)
    weights = training.run([*sentences, *draw_variants(sentences)])
    unseen = read_unseen_sentences()
    cases = cases_of(ReaderNetwork(weights), unseen)
    report(cases, unseen)
    write_reader(asked.out, weights, fit_rule(cases))


if __name__ == "__main__":
    main()
