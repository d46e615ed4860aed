"""Fit and check the confidence of answers on simulated cases with truth.

    python -m benchmarks.grounding_confidence ROOT [--check ROOT] [--bev exact noisy SOURCE ...]
                                                   [--cases 300] [--seed 0]

The cases are those of `benchmarks.grounding_cases`, the ambiguous and absent ones included: an `ok` answer to one of
them is wrong. Answers that are asked about because of a low confidence are taken as if they were acted on. The
weights are fitted on the `ok` answers of ROOT by maximum likelihood with a mild prior towards zero. The reliability
table is that of the `ok` answers on the other dataset, which the fit has not seen; without --check it is that of the
answers that were fitted.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from itertools import groupby, pairwise
from pathlib import Path
from unittest.mock import patch

import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.optimize import minimize

from appocc.checks import BoolArray, FloatArray
from appocc.errors import AppoccError
from benchmarks.grounding_cases import _has_objects, ask, judge, product_and_map
from benchmarks.grounding_truth.case_generation import make_cases
from benchmarks.grounding_truth.key_frames import Town
from grounding import answering
from grounding.confidence import Evidence, confidence_of, gather_evidence

# Strength of the prior, and edges of the bins of the table.
RIDGE = 0.5
EDGES = (0.0, 0.3, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 1.0)


def collect(root: Path, sources: Sequence[str], cases: int, seed: int) -> Iterator[tuple[Evidence, bool, float]]:
    """Yield the evidence of each `ok` answer, whether it is right, and its confidence at present."""
    town = Town(root)
    for source in sources:
        noisy, bev_source = source == "noisy", "exact" if source == "noisy" else source
        blobs = noisy or (bev_source != "exact" and not _has_objects(town, bev_source))
        made = make_cases(town, cases, seed, blobs, lambda _: None)
        for token, ours in groupby(made.cases, key=lambda case: case.token):
            grounder, bev = product_and_map(town, town.moment(token), bev_source, noisy, seed)
            for case in ours:
                answer = grounder.ground(case.sentence)
                if answer.status != "ok" or answer.target is None:
                    continue
                verdict = judge(case, ask(case.sentence, grounder), bev, bev_source == "exact" and not noisy)
                evidence = gather_evidence(
                    answer.reading, answer.referent, answer.candidates, answer.target.score, answer.scene
                )
                yield evidence, verdict.right and case.kind == "one", answer.confidence


def fit_weights(evidence: FloatArray, right: BoolArray) -> FloatArray:
    """Return the bias and one weight for each column of the evidence (N, K)."""
    columns = np.column_stack([np.ones(len(evidence)), evidence])
    sign = np.where(right, 1.0, -1.0)

    def loss(weights: FloatArray) -> float:
        return float(np.logaddexp(0, -sign * (columns @ weights)).sum() + RIDGE * (weights[1:] ** 2).sum())

    return np.asarray(minimize(loss, np.zeros(columns.shape[1])).x)


def reliability(confidence: FloatArray, right: BoolArray) -> Table:
    """Return the table of confidences and shares of right answers."""
    table = Table("confidence", "answers", "mean confidence", "right")
    for low, high in pairwise(EDGES):
        inside = (confidence >= low) & (confidence < high + (high == 1))
        if inside.any():
            mean, share = confidence[inside].mean(), right[inside].mean()
            table.add_row(f"{low:.2f} to {high:.2f}", str(inside.sum()), f"{mean:.2f}", f"{share:.2f}")
    return table


def main(words: Sequence[str] | None = None) -> None:
    """Fit the weights, print them and the reliability table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("root", type=Path)
    parser.add_argument("--check", type=Path)
    parser.add_argument("--bev", nargs="+", default=["exact", "noisy"])
    parser.add_argument("--cases", type=int, default=300)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args(words)
    console = Console(width=110)
    try:
        with patch.object(answering, "is_worth_acting", lambda confidence: True):
            rows = list(collect(given.root, given.bev, given.cases, given.seed))
            checked = list(collect(given.check, given.bev, given.cases, given.seed)) if given.check else rows
        weights = fit_weights(np.array([row[0] for row in rows]), np.array([row[1] for row in rows]))
        fitted = dict(zip(("bias", *Evidence._fields), weights.round(2).tolist(), strict=True))
        console.print(f"fitted on {len(rows)} answers: {fitted}", highlight=False)
    except AppoccError as error:
        parser.exit(2, f"{error}\n")
    evidence, right = np.array([row[0] for row in checked]), np.array([row[1] for row in checked])
    present = np.array([confidence_of(row[0]) for row in checked])
    refitted = 1 / (1 + np.exp(-(weights[0] + evidence @ weights[1:])))
    for title, confidence in (("weights of the package", present), ("weights of this fit", refitted)):
        brier = float(((confidence - right) ** 2).mean())
        console.print(f"{title}: {len(checked)} answers, {right.mean():.3f} right, Brier score {brier:.3f}")
        console.print(reliability(confidence, right))


if __name__ == "__main__":
    main()
