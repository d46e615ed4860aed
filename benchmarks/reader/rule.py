"""Weights of the votes of grammar and network, fitted on speakers that the network did not see."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor

from grounding.language.evaluation import score_command
from grounding.language.reader.fields import FIELDS, NONE
from grounding.language.reader.network import Numbers, Prediction
from grounding.language.reader.revision import (
    Evidence,
    command_odds,
    field_value,
    qualifier_numbers,
    reading_numbers,
    status_numbers,
    vote,
    vote_on_all,
)
from grounding.query import Query

# Least probability of a qualifier that the grammar does not have to be counted in the fit.
_LEAST_QUALIFIER = 0.02
_IMPOSSIBLE = -1e4


@dataclass(frozen=True, eq=False)
class Case:
    """A labelled sentence, what the grammar makes of it, and what the network predicts."""

    label: dict[str, Any]
    query: Query
    evidence: Evidence
    prediction: Prediction

    @property
    def both_accept(self) -> bool:
        """Whether it is a command, by the label and by the grammar."""
        return self.label["status"] == "ok" and self.query.action is not None


def fit_rule(cases: Sequence[Case]) -> dict[str, Numbers]:
    """Return the weights of `grounding.language.reader.revision.revise`."""
    numbers = np.array([status_numbers(one.query, one.evidence, one.prediction) for one in cases])
    accepted = np.array([one.label["status"] == "ok" for one in cases])
    rule = {"status": _fit_logistic(numbers, accepted), "qualifier": _fit_qualifiers(cases)}
    rule |= {field: _fit_field(field, [one for one in cases if one.both_accept]) for field in FIELDS}
    return rule | {"reading": _fit_reading(cases, rule)}


def _fit_reading(cases: Sequence[Case], rule: Mapping[str, Numbers]) -> Numbers:
    """Return the weights (3,) of the probability that a reading after the vote is right."""
    numbers, right = [], []
    for one in cases:
        odds = command_odds(one.query, one.evidence, one.prediction, rule)
        query = vote_on_all(one.query, odds, one.evidence, one.prediction, rule)[0]
        if query.action is not None:
            numbers.append(reading_numbers(query, odds, one.prediction))
            right.append(score_command(one.label, query.to_dict()).core_correct)
    return _fit_logistic(np.array(numbers), np.array(right))


def _fit_qualifiers(cases: Sequence[Case]) -> Numbers:
    numbers, wanted = [], []
    for one in filter(lambda case: case.both_accept, cases):
        referent = one.label["referent"] or {}
        right, optional = (referent.get(key, ()) for key in ("qualifiers", "qualifiers_optional"))
        said = one.query.referent.qualifiers if one.query.referent else ()
        for name, probability in one.prediction.qualifiers.items():
            plain = name not in said and name not in right and probability < _LEAST_QUALIFIER
            if name not in optional and not plain:
                numbers.append(qualifier_numbers(name in said, one.evidence, probability))
                wanted.append(name in right)
    return _fit_logistic(np.array(numbers), np.array(wanted))


def _fit_field(field: str, cases: Sequence[Case]) -> Numbers:
    """Return the weights (8,) that make the right values likeliest (conditional logit)."""
    values = [sorted({field_value(one.query, field), *one.prediction.choices[field]}) for one in cases]
    shape = (len(cases), max(map(len, values)))
    network, own, right = np.full(shape, _IMPOSSIBLE), np.zeros(shape), np.zeros(shape, dtype=bool)
    for i, (one, names) in enumerate(zip(cases, values, strict=True)):
        grammar = field_value(one.query, field)
        scores = vote(grammar, Evidence(), one.prediction.choices[field], np.array([1.0, *[0.0] * 7]))
        network[i, : len(names)] = [scores[name] for name in names]
        own[i, : len(names)] = [name == grammar for name in names]
        right[i, : len(names)] = [name in _right_values(one.label, field) for name in names]
    possible = right.any(axis=1)
    evidence = np.array([one.evidence.numbers() for one in cases])
    logs, owns, rights, numbers = map(as_tensor, (network, own, right, evidence))

    def loss(weights: Tensor) -> Tensor:
        scores = weights[0] * logs + owns * torch.relu(numbers @ weights[1:])[:, None]
        kept = torch.logsumexp(scores + (1 - rights) * _IMPOSSIBLE, 1) - torch.logsumexp(scores, 1)
        return -kept[torch.from_numpy(possible)].sum() + 0.5 * (weights[1:] ** 2).sum()

    return minimise(loss, np.array([1.0, 1.0, *[0.0] * 6]))


def _right_values(label: dict[str, Any], field: str) -> set[str]:
    if field in ("noun", "colour"):
        referent = label["referent"] or {}
        return {referent.get(field) or NONE, *(referent.get("noun_alt", ()) if field == "noun" else ())}
    return {label[field] or NONE, *label.get(f"{field}_alt", ())}


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
