"""Run folder: configuration, environment, metrics, checkpoints and weights of a training run."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

from appocc.environment import inspect_environment, version_of
from appocc.errors import DataError
from appocc.files import read_json, write_bytes, write_json
from appocc.temporary import locked, made_folder
from appocc.training.checkpoint import TrainingProgress
from appocc.training.config import Config, read_config
from appocc.training.summary_writer import SummaryWriter

MetricsLine = dict[str, Any]


class RunFolder:
    """`config.yaml`, `environment.json`, `metrics.jsonl`, `curves.png`, `best.safetensors` and checkpoints."""

    def __init__(self, path: Path) -> None:
        """Set the paths; nothing is read or written."""
        self.path = path
        self.config, self.environment = path / "config.yaml", path / "environment.json"
        self.summary_writer: SummaryWriter | None = None
        self.metrics, self.curves, self.best = path / "metrics.jsonl", path / "curves.png", path / "best.safetensors"

    def check(self, config: Config, resume: bool) -> None:
        """Check that a run may start here or, with `resume`, that the run of the same configuration is here.

        Raises:
            DataError: if a run or other files exist; on resume, if there is no run or one of another configuration.
        """
        if not resume:
            if self.config.exists():
                raise DataError(f"{self.path}: run exists: use --resume to continue it or choose another --out")
            self._check_empty()
            return
        if not self.config.is_file():
            raise DataError(f"{self.path}: no run to resume (no {self.config.name})")
        differing = read_config(self.config).differences(config)
        if differing:
            raise DataError(f"{self.path}: the run was started with other values of {', '.join(differing)}")

    def is_of_this_launch(self) -> bool:
        """Return whether the run here was started by this launch of torchrun, which restarts lost processes.

        All nodes decide alike: torchrun counts restarts for each node on its own, its run id is the same.

        Raises:
            DataError: if the environment of the run cannot be read.
        """
        launch = _launch()
        return launch is not None and self.config.is_file() and read_json(self.environment).get("launch") == launch

    def _check_empty(self) -> None:
        """Check that the folder is new or empty; files of a run killed while it started are allowed.

        Raises:
            DataError: if it is a file or has other files in it.
        """
        names = sorted(path.name for path in self.path.iterdir()) if self.path.is_dir() else []
        others = [name for name in names if name != self.environment.name and not name.startswith(".")]
        if others or self.path.is_file():
            got = f"one with {others[0]}" if others else "a file"
            raise DataError(f"{self.path}: expected a new or empty folder, got {got}; choose another --out")

    @contextmanager
    def lock(self) -> Iterator[None]:
        """Create the folder and lock it against other trainings; remove it at the end if it is still empty.

        Raises:
            DataError: if another training uses it, or it cannot be written.
        """
        try:
            with made_folder(self.path), locked(self.path / ".lock", self.path):
                yield
        except OSError as error:
            raise DataError(
                f"{error.filename or self.path}: cannot be written ({error.strerror or error})"
            ) from error

    def create(self, config: Config) -> None:
        """Write environment and configuration of a new run.

        Raises:
            DataError: if they cannot be written.
        """
        write_json(self.environment, {**asdict(inspect_environment(Path.cwd())), "launch": _launch()})
        write_bytes(self.config, config.as_yaml().encode())

    def clean_up(self, progress: TrainingProgress) -> None:
        """Remove partial checkpoints and the metrics of steps that will be repeated, before a run is resumed.

        Raises:
            DataError: if the metrics cannot be written.
        """
        for partial in self.path.glob(".state-*"):
            partial.unlink()
        latest = {"train": progress.step, "val": progress.evaluated}
        kept = [line for line in self.read_metrics() if line["step"] <= latest[line["kind"]]]
        write_bytes(self.metrics, "".join(json.dumps(line) + "\n" for line in kept).encode())

    def append_metrics(self, line: MetricsLine) -> None:
        """Append a line to the metrics, and to TensorBoard if it is open."""
        with self.metrics.open("a", encoding="utf-8") as file:
            file.write(json.dumps(line, allow_nan=False) + "\n")
        if self.summary_writer is not None:
            self.summary_writer.add(line)

    def open_summary_writer(self, step: int) -> None:
        """Write all further metrics to TensorBoard too, continuing after `step`.

        Raises:
            DataError: if TensorBoard is not installed.
        """
        self.summary_writer = SummaryWriter(self.path / "tensorboard", step)

    def read_metrics(self) -> list[MetricsLine]:
        """Return all lines of metrics, without a truncated last one."""
        found: list[MetricsLine] = []
        text = self.metrics.read_text(encoding="utf-8") if self.metrics.is_file() else ""
        for line in text.splitlines():
            try:
                found.append(json.loads(line))
            except ValueError:
                break
        return found

    def summary(self, progress: TrainingProgress) -> MetricsLine:
        """Return the result of the run as JSON values."""
        lines = self.read_metrics()
        best = next((line for line in lines if line["kind"] == "val" and line["step"] == progress.best_step), None)
        steps = [line for line in lines if line["kind"] == "train"]
        waited = sum(line["wait_share"] for line in steps) / len(steps) if steps else None
        paths = {"folder": str(self.path), "weights": str(self.best)}
        return {**paths, "steps": progress.step, "seconds": progress.seconds, "wait_share": waited, "best": best}

    def versions(self) -> dict[str, str]:
        """Return the versions of appocc, Python and torch for the model card."""
        environment = read_json(self.environment)
        # Of a checkout that is not installed, no required packages are known.
        installed = {package["name"]: package["version"] for package in environment["packages"]}
        torch = installed.get("torch") or version_of("torch") or "unknown"
        return {"appocc": environment["appocc"], "python": environment["python"], "torch": torch}


def _launch() -> str | None:
    """Return the run id of torchrun (`--rdzv-id`); None without torchrun or if it has none."""
    launch = os.environ.get("TORCHELASTIC_RUN_ID", "none")
    return None if launch == "none" else launch
