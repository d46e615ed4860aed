"""Weights by which grammar and network are joined, fitted on speakers that the network did not see."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor

from grounding.language.evaluation import score_command
from grounding.language.reader.network import Numbers, Prediction
from grounding.language.reader.revision import (
    Evidence,
    choose,
    command_odds,
    reading_numbers,
    status_numbers,
)
from grounding.query import Query


@dataclass(frozen=True, eq=False)
class Case:
    """A labelled sentence, what the grammar makes of it, and what the network predicts."""

    label: dict[str, Any]
    query: Query
    evidence: Evidence
    prediction: Prediction


def fit_rule(cases: Sequence[Case]) -> dict[str, Numbers]:
    """Return the weights of `grounding.language.reader.revision.revise`."""
    numbers = np.array([status_numbers(one.query, one.evidence, one.prediction) for one in cases])
    accepted = np.array([one.label["status"] == "ok" for one in cases])
    rule = {"status": _fit_logistic(numbers, accepted)}
    return rule | {"reading": _fit_reading(cases, rule)}


def _fit_reading(cases: Sequence[Case], rule: Mapping[str, Numbers]) -> Numbers:
    """Return the weights (3,) of the probability that the chosen reading is right."""
    numbers, right = [], []
    for one in cases:
        odds = command_odds(one.query, one.evidence, one.prediction, rule)
        query = choose(one.query, odds, one.evidence, one.prediction)[0]
        if query.action is not None:
            numbers.append(reading_numbers(query, odds, one.prediction))
            right.append(score_command(one.label, query.to_dict()).core_correct)
    return _fit_logistic(np.array(numbers), np.array(right))


def _fit_logistic(numbers: Numbers, wanted: Numbers) -> Numbers:
    inputs, outputs = as_tensor(numbers), as_tensor(wanted)

    def loss(weights: Tensor) -> Tensor:
        odds = inputs @ weights
        return (torch.logaddexp(torch.zeros(()), odds) - outputs * odds).sum() + 0.5 * (weights**2).sum()

    return minimise(loss, np.zeros(numbers.shape[1]))


def minimise(loss: Callable[[Tensor], Tensor], start: Numbers) -> Numbers:
    """Return the weights at which a loss is least."""
    weights = as_tensor(start).requires_grad_()
    optimiser = torch.optim.LBFGS([weights], max_iter=100, line_search_fn="strong_wolfe")

    def closure() -> float:
        optimiser.zero_grad()
        value = loss(weights)
        torch.autograd.backward(value)
        return value.item()

    optimiser.step(closure)  # type: ignore[no-untyped-call]
    result = weights.detach().numpy()
    if not all(map(math.isfinite, result)):
        raise ValueError("fit: expected finite weights")
    return result.astype(np.float32)


def as_tensor(values: Any) -> Tensor:
    """Return numbers as a tensor of double precision."""
    return torch.from_numpy(np.asarray(values, dtype=np.float64).copy())
