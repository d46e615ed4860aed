from __future__ import annotations

import hashlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import torch
from made_training import TinyModel, made_config, run
from safetensors import safe_open

from appocc.errors import DataError
from appocc.training.checkpoint import Progress, load_state, save_state, states
from appocc.training.config import Config
from appocc.training.loop import _optimizer
from appocc.training.run import StoppedError, Watcher
from appocc.training.run_folder import RunFolder

TIMES = ("seconds", "wait_share", "plan_share", "samples_per_s", "evaluation_s")


class KilledError(Exception):
    """Stands for kill -9: nothing is written after it."""


@pytest.fixture(autouse=True, scope="module")
def no_pictures() -> Iterator[None]:
    """Curves take longer than these trainings, and are drawn elsewhere."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("appocc.training.loop.draw_curves", lambda lines, path: None)
        yield


def numbers(folder: Path) -> list[dict[str, Any]]:
    """Lines of metrics without what a clock says."""
    return [{k: v for k, v in line.items() if k not in TIMES} for line in RunFolder(folder).lines()]


def tensors(folder: Path) -> dict[str, str]:
    """Digests of all tensors of the latest state, and of the file of the best weights with its card."""
    found = {"best": hashlib.sha256((folder / "best.safetensors").read_bytes()).hexdigest()}
    with safe_open(states(folder)[0], framework="pt") as file:
        for name in file.keys():  # noqa: SIM118
            found[name] = hashlib.sha256(file.get_tensor(name).numpy().tobytes()).hexdigest()
    return found


def at_step(number: int, stop: bool) -> Watcher:
    """Asks to stop after a step, or dies there."""
    watcher = Watcher()

    def step(share: float, text: str) -> None:
        if text.startswith(f"step {number},"):
            if not stop:
                raise KilledError
            watcher.stop = True

    watcher.step = step
    return watcher


CONFIGS = {
    "plain": made_config(),
    "accumulated": made_config(train__accumulate=3, train__steps=9, evaluate__every_steps=4, save__every_steps=2),
    "bf16": made_config(train__precision="bf16"),
}


@pytest.fixture(scope="module", params=CONFIGS)
def uninterrupted(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Config, Path]:
    config = CONFIGS[request.param]
    folder = tmp_path_factory.mktemp("whole") / "run"
    run(folder, config)
    return config, folder


@pytest.mark.parametrize("number", [1, 5, 7])
@pytest.mark.parametrize("stop", [True, False], ids=["stopped", "killed"])
def test_interrupted_is_as_uninterrupted(
    tmp_path: Path, uninterrupted: tuple[Config, Path], number: int, stop: bool
) -> None:
    config, whole = uninterrupted
    folder = tmp_path / "run"
    with pytest.raises(StoppedError if stop else KilledError):
        run(folder, config, at_step(number, stop))
    run(folder, config, resume=True)
    assert numbers(folder) == numbers(whole)
    assert tensors(folder) == tensors(whole)


def test_killed_in_an_evaluation(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole, folder, config = tmp_path / "whole", tmp_path / "run", made_config(save__every_steps=5)
    run(whole, config)

    def killed(run: Any) -> None:
        raise KilledError

    with monkeypatch.context() as patched:
        patched.setattr("appocc.training.loop.validate", killed)
        with pytest.raises(KilledError):
            run(folder, config)
    run(folder, config, resume=True)
    assert numbers(folder) == numbers(whole)
    assert tensors(folder) == tensors(whole)


def test_two_states_are_kept_and_a_damaged_one_is_left_aside(tmp_path: Path) -> None:
    whole, folder = tmp_path / "whole", tmp_path / "run"
    said: list[str] = []
    run(whole, made_config())
    with pytest.raises(KilledError):
        run(folder, made_config(), at_step(9, stop=False))
    assert [path.name for path in states(folder)] == ["state-00000008.safetensors", "state-00000004.safetensors"]
    latest = states(folder)[0]
    latest.write_bytes(latest.read_bytes()[:5000])
    (folder / ".state-00000012.partial.safetensors").write_bytes(b"half")
    with (folder / "metrics.jsonl").open("a") as file:
        file.write('{"kind": "train", "st')
    run(folder, made_config(), Watcher(say=said.append), resume=True)
    assert any("left aside" in line and "state-00000008" in line for line in said)
    assert numbers(folder) == numbers(whole)
    assert tensors(folder) == tensors(whole)
    assert not list(folder.glob(".state*"))


def test_a_finished_run_stays_as_it_is(tmp_path: Path) -> None:
    run(tmp_path / "run", made_config())
    before = (tmp_path / "run" / "metrics.jsonl").read_bytes(), tensors(tmp_path / "run")
    run(tmp_path / "run", made_config(), resume=True)
    assert ((tmp_path / "run" / "metrics.jsonl").read_bytes(), tensors(tmp_path / "run")) == before


def test_a_run_that_is_there_is_not_written_over(tmp_path: Path) -> None:
    run(tmp_path / "run", made_config(train__steps=1))
    with pytest.raises(DataError, match=r"run: there is a run already; --resume"):
        run(tmp_path / "run", made_config(train__steps=1))


def test_only_the_same_training_goes_on(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="no run to go on with"):
        run(tmp_path / "run", made_config(), resume=True)
    run(tmp_path / "run", made_config(train__steps=1))
    with pytest.raises(DataError, match=r"other values of train.steps, losses.colour$"):
        run(tmp_path / "run", made_config(train__steps=2, losses__colour=3.0), resume=True)


def test_a_state_holds_the_optimizers_moments_and_no_pickle(tmp_path: Path) -> None:
    config = made_config()
    model, average = TinyModel(), TinyModel()
    optimizer = _optimizer(model, config)
    for parameter in model.parameters():
        parameter.grad = torch.rand_like(parameter)
    optimizer.step()
    path = save_state(tmp_path, Progress(step=3, seconds=0.1), model, average, optimizer)
    other = TinyModel(), TinyModel()
    others = _optimizer(other[0], config)
    assert load_state(path, *other, others) == Progress(step=3, seconds=0.1)
    assert all(torch.equal(a, b) for a, b in zip(model.parameters(), other[0].parameters(), strict=True))
    mine, theirs = optimizer.state_dict()["state"], others.state_dict()["state"]
    assert mine.keys() == theirs.keys()
    assert all(torch.equal(mine[k][name], theirs[k][name]) for k in mine for name in mine[k])


def test_a_state_of_other_parts_is_told(tmp_path: Path) -> None:
    model = TinyModel()
    optimizer = _optimizer(model, made_config())
    path = save_state(tmp_path, Progress(), model, TinyModel(), optimizer)
    small = TinyModel(appearance=False)
    with pytest.raises(DataError, match="no state of this training"):
        load_state(path, small, TinyModel(appearance=False), _optimizer(small, made_config()))
