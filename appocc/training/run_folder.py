"""The folder of a run: what it was told, where, how it went, and what came out."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

from appocc.environment import inspect_environment
from appocc.errors import DataError
from appocc.files import read_json, write_bytes, write_json
from appocc.temporary import locked, made_folder
from appocc.training.checkpoint import Progress
from appocc.training.config import Config, read_config
from appocc.training.summary_writer import Board

Line = dict[str, Any]


class RunFolder:
    """`config.yaml`, `environment.json`, `metrics.jsonl`, `curves.png`, `best.safetensors` and the latest states."""

    def __init__(self, path: Path) -> None:
        """Name the folder; nothing is read or written."""
        self.path = path
        self.config, self.environment = path / "config.yaml", path / "environment.json"
        self.board: Board | None = None
        self.metrics, self.curves, self.best = path / "metrics.jsonl", path / "curves.png", path / "best.safetensors"

    def check(self, config: Config, resume: bool) -> None:
        """Check that a run may begin, or go on, here.

        Raises:
            DataError: if there is a run already or something else, or no run to go on with, or of another training.
        """
        if not resume:
            if self.config.exists():
                raise DataError(f"{self.path}: there is a run already; --resume goes on with it, --out names another")
            self._check_empty()
            return
        if not self.config.is_file():
            raise DataError(f"{self.path}: no run to go on with (no {self.config.name})")
        differing = read_config(self.config).differences(config)
        if differing:
            raise DataError(f"{self.path}: this run was begun with other values of {', '.join(differing)}")

    def _check_empty(self) -> None:
        """Check that nothing is in the folder but what `begin` leaves if it is killed.

        Raises:
            DataError: if it is no folder, or something else is in it.
        """
        names = sorted(path.name for path in self.path.iterdir()) if self.path.is_dir() else []
        others = [name for name in names if name != self.environment.name and not name.startswith(".")]
        if others or self.path.is_file():
            got = f"one with {others[0]}" if others else "a file"
            raise DataError(f"{self.path}: expected a new or empty folder, got {got}; --out names another")

    @contextmanager
    def held(self) -> Iterator[None]:
        """Keep other trainings out of the folder, which is made; if nothing comes into it, it is removed.

        Raises:
            DataError: if another training is at work in it, or it cannot be written.
        """
        try:
            with made_folder(self.path), locked(self.path / ".lock", self.path):
                yield
        except OSError as error:
            raise DataError(
                f"{error.filename or self.path}: cannot be written ({error.strerror or error})"
            ) from error

    def begin(self, config: Config) -> None:
        """Make the folder.

        Raises:
            DataError: if it cannot be written.
        """
        write_json(self.environment, asdict(inspect_environment(Path.cwd())))
        write_bytes(self.config, config.as_yaml().encode())

    def go_on(self, progress: Progress) -> None:
        """Remove what was left half written, and the lines of what will be done again.

        Raises:
            DataError: if it cannot be written.
        """
        for left in self.path.glob(".state-*"):
            left.unlink()
        latest = {"train": progress.step, "val": progress.evaluated}
        kept = [line for line in self.lines() if line["step"] <= latest[line["kind"]]]
        write_bytes(self.metrics, "".join(json.dumps(line) + "\n" for line in kept).encode())

    def add(self, line: Line) -> None:
        """Append a line of metrics."""
        with self.metrics.open("a", encoding="utf-8") as file:
            file.write(json.dumps(line, allow_nan=False) + "\n")
        if self.board is not None:
            self.board.add(line)

    def show(self, step: int) -> None:
        """Show the lines that come in TensorBoard as well, after a step.

        Raises:
            DataError: if it is not installed.
        """
        self.board = Board(self.path / "tensorboard", step)

    def lines(self) -> list[Line]:
        """All lines of metrics; one that was cut off is left out."""
        found: list[Line] = []
        text = self.metrics.read_text(encoding="utf-8") if self.metrics.is_file() else ""
        for line in text.splitlines():
            try:
                found.append(json.loads(line))
            except ValueError:
                break
        return found

    def summary(self, progress: Progress) -> Line:
        """What came of the run, for machines."""
        lines = self.lines()
        best = next((line for line in lines if line["kind"] == "val" and line["step"] == progress.best_step), None)
        steps = [line for line in lines if line["kind"] == "train"]
        waited = sum(line["wait_share"] for line in steps) / len(steps) if steps else None
        told = {"folder": str(self.path), "weights": str(self.best), "steps": progress.step}
        return {**told, "seconds": progress.seconds, "wait_share": waited, "best": best}

    def versions(self) -> dict[str, str]:
        """Versions of what a run depends on, for the weights' card."""
        there = read_json(self.environment)
        torch = next(package["version"] for package in there["packages"] if package["name"] == "torch")
        return {"appocc": there["appocc"], "python": there["python"], "torch": torch}
