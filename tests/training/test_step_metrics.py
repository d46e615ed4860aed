"""Metrics that stay on the device until the log interval: same lines, same weights, same errors."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest
from made_training import Poison, made_config, run

from appocc.training.checkpoint import list_checkpoints
from appocc.training.run import StoppedError, TrainingError, TrainingMonitor
from appocc.training.run_folder import RunFolder

TIMES = ("seconds", "wait_share", "plan_share", "samples_per_s", "evaluation_s")


@pytest.fixture
def deferred(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fetch metrics as on a GPU: at the log interval, and before evaluations and checkpoints."""
    monkeypatch.setattr("appocc.training.step_metrics.fetches_every_step", lambda run: False)


def numbers(folder: Path) -> list[dict[str, Any]]:
    """Lines of metrics without times."""
    return [{k: v for k, v in line.items() if k not in TIMES} for line in RunFolder(folder).read_metrics()]


@pytest.mark.parametrize("accumulate", [1, 2])
def test_fetching_later_changes_neither_metrics_nor_weights(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, accumulate: int
) -> None:
    config = made_config(train__steps=33, train__accumulate=accumulate, evaluate__every_steps=7, save__every_steps=8)
    run(tmp_path / "every", config)
    shown: list[str] = []
    monkeypatch.setattr("appocc.training.step_metrics.fetches_every_step", lambda run: False)
    run(tmp_path / "later", config, TrainingMonitor(lambda share, text: shown.append(text)))
    assert numbers(tmp_path / "later") == numbers(tmp_path / "every")
    best = [(tmp_path / name / "best.safetensors").read_bytes() for name in ("every", "later")]
    assert best[0] == best[1]
    steps = [line["step"] for line in numbers(tmp_path / "later") if line["kind"] == "train"]
    assert steps == [10, 20, 30, 33]
    assert shown[0] == "step 1"
    assert shown[6].startswith("step 7, ")
    assert shown[7] == "step 7: validating, batch 1"
    following = next(text for text in shown if text.startswith("step 8"))
    assert "samples/s, road" in following


def test_every_step_counts_in_time_and_samples(tmp_path: Path, deferred: None) -> None:
    run(tmp_path / "run", made_config(train__steps=20))
    first, second = (line for line in RunFolder(tmp_path / "run").read_metrics() if line["kind"] == "train")
    assert 0 < first["seconds"] < second["seconds"]
    assert first["samples_per_s"] == pytest.approx(10 * 4 / first["seconds"])
    assert second["samples_per_s"] == pytest.approx(10 * 4 / (second["seconds"] - first["seconds"]))


@pytest.mark.parametrize(("factor", "reason"), [(math.nan, "step 13: expected finite"), (1e6, "step 13: expected a")])
def test_divergence_is_found_before_anything_is_saved(
    tmp_path: Path, deferred: None, factor: float, reason: str
) -> None:
    folder = tmp_path / "run"
    with pytest.raises(TrainingError, match=rf"^{reason}.*best.safetensors is kept\)$"):
        run(folder, made_config(train__steps=20, save__every_steps=6), poison=Poison(12, factor))
    assert [path.name for path in list_checkpoints(folder)] == [
        "state-00000012.safetensors",
        "state-00000010.safetensors",
    ]
    assert [line["step"] for line in numbers(folder) if line["kind"] == "val"] == [5, 10]


def test_a_stop_between_fetches_keeps_the_metrics(tmp_path: Path, deferred: None) -> None:
    config, monitor = made_config(train__steps=30), TrainingMonitor()
    monitor.on_step = lambda share, text: setattr(monitor, "stop_requested", text.startswith("step 13"))
    run(tmp_path / "whole", config)
    with pytest.raises(StoppedError, match="after step 13;"):
        run(tmp_path / "run", config, monitor)
    run(tmp_path / "run", config, resume=True)
    assert numbers(tmp_path / "run") == numbers(tmp_path / "whole")
