"""A file that answers differently is found out, whenever it does."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import torch
from numpy.typing import NDArray

from appocc.checks import Float32Array
from appocc.export.parity import THREADS, Parity, measure_parity, parity_limit, synthetic_inputs
from appocc.export.runtimes import Outputs, Runner
from appocc.models.model_spec import MODEL_SPECS
from appocc.models.registry import NETWORKS, build

LIMIT = 1e-4
SHAPE = (1, 2, 3, 20, 40)
Twist = Callable[[dict[str, NDArray[Any]], int, int], None]


def network(images: Float32Array) -> Outputs:
    mean = images.mean(axis=(1, 3, 4), dtype=np.float32)
    return {"occupancy": mean, "seen": np.array([[True, False]])}


def judged(twist: Twist) -> Parity:
    """Compare the network with itself, its answers twisted by number of threads and count of runs."""

    def open_file(threads: int) -> Runner:
        count = 0

        def run(images: Float32Array) -> Outputs:
            nonlocal count
            count += 1
            answers = {name: value.copy() for name, value in network(images).items()}
            twist(answers, threads, count)
            return answers

        return run

    return measure_parity(network, open_file, synthetic_inputs(SHAPE), LIMIT, 3, lambda _: None)


def test_the_same_answers_hold() -> None:
    parity = judged(lambda answers, threads, count: None)
    assert parity.holds
    assert parity.largest == {"occupancy": 0, "seen": 0}
    assert parity.between_runs == 0
    value = parity.as_json()
    assert value["threads"] == [1, 2, 4]
    assert value["inputs"] == ["noise", "patches", "grey"]
    assert value["median_ms"]["torch"] > 0
    assert "27 runs: 3 inputs" in parity.lines()[1]


def test_how_far_is_told_and_the_limit_is_kept() -> None:
    def slightly(answers: dict[str, NDArray[Any]], threads: int, count: int) -> None:
        answers["occupancy"] += np.float32(LIMIT / 2)

    parity = judged(slightly)
    assert parity.holds
    assert parity.largest["occupancy"] == pytest.approx(LIMIT / 2, rel=0.01)


def _once(answers: dict[str, NDArray[Any]], threads: int, count: int) -> None:
    answers["occupancy"] += np.float32(2 * LIMIT if count == 9 else 0)


def _at_four_threads(answers: dict[str, NDArray[Any]], threads: int, count: int) -> None:
    answers["occupancy"][0, 1] += np.float32(2 * LIMIT if threads == THREADS[-1] else 0)


def _not_a_number(answers: dict[str, NDArray[Any]], threads: int, count: int) -> None:
    answers["occupancy"][0, 0] = np.nan


def _missing(answers: dict[str, NDArray[Any]], threads: int, count: int) -> None:
    del answers["seen"]


def _other_shape(answers: dict[str, NDArray[Any]], threads: int, count: int) -> None:
    answers["occupancy"] = answers["occupancy"][:, :1]


def _seen_elsewhere(answers: dict[str, NDArray[Any]], threads: int, count: int) -> None:
    answers["seen"] = ~answers["seen"]


@pytest.mark.parametrize("twist", [_once, _at_four_threads, _not_a_number, _missing, _other_shape, _seen_elsewhere])
def test_what_differs_is_found_out(twist: Twist) -> None:
    parity = judged(twist)
    assert not parity.holds
    if twist is _once:
        assert parity.between_runs == pytest.approx(2 * LIMIT, rel=0.01)


@pytest.mark.parametrize("name", NETWORKS)
def test_the_limit_grows_with_a_networks_sums_and_is_far_below_what_is_seen(name: str) -> None:
    with torch.device("meta"):
        model = build(name, MODEL_SPECS["360"])
    assert 3e-5 < parity_limit(model) < 3e-4
    assert parity_limit(model.double()) == parity_limit(model)  # files compute in float32 whatever the network does


def test_made_inputs_are_pictures_and_the_same_each_time() -> None:
    made = synthetic_inputs(SHAPE)
    for name, images in made.items():
        assert images.shape == SHAPE, name
        assert images.dtype == np.float32
        assert 0 <= images.min() <= images.max() <= 1
        assert np.array_equal(images, synthetic_inputs(SHAPE)[name])
    assert made["noise"].std() > 0.2
