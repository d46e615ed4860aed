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
from appocc.training.checkpoint import TrainingProgress, list_checkpoints, load_checkpoint, save_checkpoint
from appocc.training.config import Config
from appocc.training.loop import _optimizer
from appocc.training.run import StoppedError, TrainingMonitor
from appocc.training.run_folder import RunFolder

TIMES = ("seconds", "wait_share", "plan_share", "samples_per_s", "evaluation_s")


class KilledError(Exception):
    """Stands for kill -9: nothing is written after it."""


@pytest.fixture(autouse=True, scope="module")
def no_pictures() -> Iterator[None]:
    """Curves take longer than these trainings, and are drawn elsewhere."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("appocc.training.loop.plot_curves", lambda lines, path: None)
        yield


def numbers(folder: Path) -> list[dict[str, Any]]:
    """Lines of metrics without what a clock says."""
    return [{k: v for k, v in line.items() if k not in TIMES} for line in RunFolder(folder).read_metrics()]


def tensors(folder: Path) -> dict[str, str]:
    """Digests of all tensors of the latest state, and of the file of the best weights with its card."""
    found = {"best": hashlib.sha256((folder / "best.safetensors").read_bytes()).hexdigest()}
    with safe_open(list_checkpoints(folder)[0], framework="pt") as file:
        for name in file.keys():  # noqa: SIM118
            found[name] = hashlib.sha256(file.get_tensor(name).numpy().tobytes()).hexdigest()
    return found


def at_step(number: int, stop: bool) -> TrainingMonitor:
    """Asks to stop after a step, or dies there."""
    monitor = TrainingMonitor()

    def step(share: float, text: str) -> None:
        if text.startswith(f"step {number},"):
            if not stop:
                raise KilledError
            monitor.stop_requested = True

    monitor.on_step = step
    return monitor


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


def test_two_checkpoints_are_kept_and_a_damaged_one_is_skipped(tmp_path: Path) -> None:
    whole, folder = tmp_path / "whole", tmp_path / "run"
    said: list[str] = []
    run(whole, made_config())
    with pytest.raises(KilledError):
        run(folder, made_config(), at_step(9, stop=False))
    assert [path.name for path in list_checkpoints(folder)] == [
        "state-00000008.safetensors",
        "state-00000005.safetensors",
    ]
    latest = list_checkpoints(folder)[0]
    latest.write_bytes(latest.read_bytes()[:5000])
    (folder / ".state-00000012.partial.safetensors").write_bytes(b"half")
    with (folder / "metrics.jsonl").open("a") as file:
        file.write('{"kind": "train", "st')
    run(folder, made_config(), TrainingMonitor(on_message=said.append), resume=True)
    assert any("checkpoint skipped" in line and "state-00000008" in line for line in said)
    assert numbers(folder) == numbers(whole)
    assert tensors(folder) == tensors(whole)
    assert not list(folder.glob(".state*"))


def test_a_finished_run_stays_as_it_is(tmp_path: Path) -> None:
    run(tmp_path / "run", made_config())
    before = (tmp_path / "run" / "metrics.jsonl").read_bytes(), tensors(tmp_path / "run")
    run(tmp_path / "run", made_config(), resume=True)
    assert ((tmp_path / "run" / "metrics.jsonl").read_bytes(), tensors(tmp_path / "run")) == before


def test_an_existing_run_is_not_overwritten(tmp_path: Path) -> None:
    run(tmp_path / "run", made_config(train__steps=1))
    with pytest.raises(DataError, match=r"run: run exists: use --resume"):
        run(tmp_path / "run", made_config(train__steps=1))


def test_only_the_same_configuration_resumes(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="no run to resume"):
        run(tmp_path / "run", made_config(), resume=True)
    run(tmp_path / "run", made_config(train__steps=1))
    with pytest.raises(DataError, match=r"other values of train.steps, losses.colour$"):
        run(tmp_path / "run", made_config(train__steps=2, losses__colour=3.0), resume=True)


def test_a_checkpoint_restores_the_optimizer(tmp_path: Path) -> None:
    config = made_config()
    model, average = TinyModel(), TinyModel()
    optimizer = _optimizer(model, config)
    for parameter in model.parameters():
        parameter.grad = torch.rand_like(parameter)
    optimizer.step()
    path = save_checkpoint(tmp_path, TrainingProgress(step=3, seconds=0.1), model, average, optimizer)
    other = TinyModel(), TinyModel()
    others = _optimizer(other[0], config)
    assert load_checkpoint(path, *other, others) == TrainingProgress(step=3, seconds=0.1)
    assert all(torch.equal(a, b) for a, b in zip(model.parameters(), other[0].parameters(), strict=True))
    mine, theirs = optimizer.state_dict()["state"], others.state_dict()["state"]
    assert mine.keys() == theirs.keys()
    assert all(torch.equal(mine[k][name], theirs[k][name]) for k in mine for name in mine[k])


def test_a_checkpoint_of_another_network_is_refused(tmp_path: Path) -> None:
    model = TinyModel()
    optimizer = _optimizer(model, made_config())
    path = save_checkpoint(tmp_path, TrainingProgress(), model, TinyModel(), optimizer)
    small = TinyModel(appearance=False)
    with pytest.raises(DataError, match="checkpoint belongs to another run"):
        load_checkpoint(path, small, TinyModel(appearance=False), _optimizer(small, made_config()))
