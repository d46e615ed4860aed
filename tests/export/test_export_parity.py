"""A file that answers differently is found out, whenever it does."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pytest
import torch
from made_export import ALL_PARTS
from numpy.typing import NDArray

from appocc.export.clips import synthetic_clips
from appocc.export.parity import THREADS, Parity, measure_parity, parity_limit
from appocc.export.runtimes import Inputs, Outputs, Runner
from appocc.models.model_spec import MODEL_SPECS, Parts
from appocc.models.registry import NETWORKS, build

LIMIT = 1e-4
SHAPE = (1, 2, 3, 20, 40)
SHAPES = {"images": SHAPE}
WITH_MEMORY = {**SHAPES, "memory": (1, 3, 6, 6), "past_from_now": (1, 2, 3), "elapsed_s": (1,)}
Twist = Callable[[dict[str, NDArray[Any]], int, int], None]


def network(inputs: Inputs) -> Outputs:
    mean = inputs["images"].mean(axis=(1, 3, 4), dtype=np.float32)
    outputs = {"occupancy": mean, "seen": np.array([[True, False]])}
    if "memory" in inputs:
        outputs["next_memory"] = np.asarray(inputs["memory"] + mean[..., None, None] * inputs["elapsed_s"])
    return outputs


def judged(twist: Twist, shapes: Mapping[str, tuple[int, ...]] = SHAPES) -> Parity:
    """Compare the network with itself, its answers twisted by number of threads and count of runs."""

    def open_file(threads: int) -> Runner:
        count = 0

        def run(inputs: Inputs) -> Outputs:
            nonlocal count
            count += 1
            answers = {name: value.copy() for name, value in network(inputs).items()}
            twist(answers, threads, count)
            return answers

        return run

    return measure_parity(network, open_file, synthetic_clips(shapes), LIMIT, 3, lambda _: None)


def test_the_same_answers_hold() -> None:
    parity = judged(lambda answers, threads, count: None)
    assert parity.holds
    assert parity.largest == {"occupancy": 0, "seen": 0}
    assert parity.between_runs == 0
    value = parity.as_json()
    assert value["threads"] == [1, 2, 4]
    assert value["inputs"] == ["noise", "patches", "grey"]
    assert value["frames"] == 1
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


def _forgets(answers: dict[str, NDArray[Any]], threads: int, count: int) -> None:
    answers["next_memory"] *= 0


def _drifts(answers: dict[str, NDArray[Any]], threads: int, count: int) -> None:
    answers["next_memory"] += np.float32(LIMIT / 2)  # within the limit in each frame, but not after three


def _returns_no_memory(answers: dict[str, NDArray[Any]], threads: int, count: int) -> None:
    del answers["next_memory"]


@pytest.mark.parametrize("twist", [_forgets, _drifts, _returns_no_memory])
def test_the_file_gets_its_own_memory_back(twist: Twist) -> None:
    assert judged(lambda answers, threads, count: None, WITH_MEMORY).holds
    parity = judged(twist, WITH_MEMORY)
    assert not parity.holds
    assert parity.frames == 3
    assert "3 inputs of up to 3 consecutive frames" in parity.lines()[1]


def test_differences_are_relative_to_the_size_of_an_output() -> None:
    def scaled(answers: dict[str, NDArray[Any]], threads: int, count: int) -> None:
        answers["boxes"] = np.array([100.0 + LIMIT * 50, 0.0], np.float32)
        answers["small"] = np.array([0.001 + LIMIT / 2], np.float32)

    def sized(inputs: Inputs) -> Outputs:
        return {"boxes": np.array([100.0, 0.0], np.float32), "small": np.array([0.001], np.float32)}

    def twisted(inputs: Inputs) -> Outputs:
        answers = {name: value.copy() for name, value in sized(inputs).items()}
        scaled(answers, 1, 0)
        return answers

    parity = measure_parity(sized, lambda threads: twisted, synthetic_clips(SHAPES), LIMIT, 1, lambda _: None)
    assert parity.holds
    assert parity.largest["boxes"] == pytest.approx(LIMIT / 2, rel=0.01)
    assert parity.largest["small"] == pytest.approx(LIMIT / 2, rel=0.01)


def test_the_limit_grows_with_the_frames_of_a_network_with_memory() -> None:
    with torch.device("meta"):
        plain, whole = (build("appocc", MODEL_SPECS["360"], parts=parts) for parts in (Parts(), ALL_PARTS))
    assert parity_limit(plain, 3) == parity_limit(plain)
    assert parity_limit(whole, 3) == pytest.approx(3**0.5 * parity_limit(whole))
    assert parity_limit(whole, 3) < 5e-4


@pytest.mark.parametrize("name", NETWORKS)
def test_the_limit_grows_with_a_networks_sums_and_is_far_below_what_is_seen(name: str) -> None:
    with torch.device("meta"):
        model = build(name, MODEL_SPECS["360"])
    assert 3e-5 < parity_limit(model) < 3e-4
    assert parity_limit(model.double()) == parity_limit(model)  # files compute in float32 whatever the network does


def test_made_inputs_are_pictures_and_the_same_each_time() -> None:
    made, again = synthetic_clips(WITH_MEMORY), synthetic_clips(WITH_MEMORY)
    for name, clip in made.items():
        assert len(clip) == 3
        assert clip[0].keys() == WITH_MEMORY.keys()
        for number, inputs in enumerate(clip):
            assert inputs["images"].min() >= 0
            assert inputs["images"].max() <= 1
            assert 1 <= inputs["past_from_now"][0, 0, 2] <= 2
            for key, values in inputs.items():
                assert values.shape == WITH_MEMORY[key], name
                assert values.dtype == np.float32
                assert np.array_equal(values, again[name][number][key])
    assert made["noise"][0]["images"].std() > 0.2
    assert not np.array_equal(made["noise"][0]["images"], made["noise"][1]["images"])
    alone = synthetic_clips(SHAPES)
    assert {name: len(clip) for name, clip in alone.items()} == {"noise": 1, "patches": 1, "grey": 1}
    assert np.array_equal(alone["noise"][0]["images"], made["noise"][0]["images"])
