"""Ablation study: train and evaluate each row, then write the tables; an interrupted study can be resumed."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from appocc.ablation.result import read_result
from appocc.ablation.row_evaluation import EvaluationSet, MapPredictor, evaluate_row
from appocc.ablation.rows import StudyRow
from appocc.errors import DataError
from appocc.files import write_json
from appocc.training.checkpoint import list_checkpoints
from appocc.training.config import Config
from appocc.training.run import StoppedError, TrainingError, TrainingMonitor
from appocc.training.run_folder import RunFolder

_RESULT = "result.json"
_TRAINING_SHARE = 0.9  # of the progress of a row


class Train(Protocol):
    """Trains with a configuration in a run folder, such as `session.run_training`."""

    def __call__(
        self, config: Config, folder: RunFolder, resume: bool, monitor: TrainingMonitor
    ) -> Mapping[str, Any]:
        """Return the summary of the run."""
        ...


class RowOutcome(NamedTuple):
    """State and result of a row.

    Attributes:
        row: the row.
        state: done; failed (the training diverged); begun; not run.
        result: content of `result.json`: `steps`, `best_step`, `seconds` and `evaluation` if done, `reason` if
            failed; `steps` if begun; empty if not run.
    """

    row: StudyRow
    state: str
    result: Mapping[str, Any]


@dataclass(frozen=True, kw_only=True, eq=False)
class Study:
    """An ablation study.

    Attributes:
        base: configuration shared by all rows.
        rows: all rows in order.
        test: test set.
        out: folder of runs and results.
        train: trains a row.
        predictor_of: returns the predictor of a row from its weights (None without learning).
        write: writes the tables of all outcomes.
    """

    base: Config
    rows: Sequence[StudyRow]
    test: EvaluationSet
    out: Path
    train: Train
    predictor_of: Callable[[StudyRow, Path | None], MapPredictor]
    write: Callable[[Study, Sequence[RowOutcome]], None]

    def check(self) -> None:
        """Check test set and folders before the first training.

        Raises:
            DataError: if the test set cannot be used, or the folder has another study.
        """
        if int(os.environ.get("WORLD_SIZE", "1")) > 1:
            raise DataError("ablate: expected one process, got several (torchrun); distribute the rows with --only")
        self.test.check()
        for row in self.rows:
            folder = self.folder(row)
            if row.learns and folder.config.is_file():
                folder.check(row.config(self.base), resume=True)

    def folder(self, row: StudyRow) -> RunFolder:
        """Return the run folder of a row."""
        return RunFolder(self.out / row.name)

    def run(
        self, chosen: Sequence[StudyRow], monitor: TrainingMonitor, time_is_up: Callable[[], bool]
    ) -> list[RowOutcome]:
        """Train and evaluate the chosen rows until the time is up; return the outcomes of all rows.

        Tables are written at the start and after each row. A training that is interrupted keeps its checkpoint.

        Raises:
            AppoccError: if data are missing or damaged, or the folder cannot be written.
            StoppedError: if the monitor requested a stop.
        """
        self.write(self, self.outcomes())
        for number, row in enumerate(chosen):
            if time_is_up():
                break
            if self._outcome(row).state in ("done", "failed"):
                continue
            try:
                with _row_progress(monitor, row.name, number, len(chosen), time_is_up):
                    self._finish(row, monitor)
            except StoppedError:
                if not time_is_up():
                    raise
                break
            finally:
                self.write(self, self.outcomes())
        return self.outcomes()

    def outcomes(self) -> list[RowOutcome]:
        """Return the outcome of every row, from its folder."""
        return [self._outcome(row) for row in self.rows]

    def _outcome(self, row: StudyRow) -> RowOutcome:
        folder = self.folder(row)
        path = folder.path / _RESULT
        if path.is_file():
            result = read_result(path, self._key(row))
            if result is not None:
                return RowOutcome(row, "failed" if "reason" in result else "done", result)
        if not folder.config.is_file():
            return RowOutcome(row, "not run", {})
        checkpoints = list_checkpoints(folder.path)
        return RowOutcome(row, "begun", {"steps": int(checkpoints[0].stem.partition("-")[2]) if checkpoints else 0})

    def _finish(self, row: StudyRow, monitor: TrainingMonitor) -> None:
        """Train and evaluate a row and write its result; finished parts are not repeated."""
        folder = self.folder(row)
        result: dict[str, Any] = {}
        if row.learns:
            _clear_unstarted(folder)
            try:
                trained = self.train(row.config(self.base), folder, folder.path.exists(), monitor)
            except TrainingError as error:
                write_json(folder.path / _RESULT, {"key": self._key(row), "reason": str(error)})
                monitor.on_message(str(error))
                return
            result = {"steps": trained["steps"], "seconds": trained["seconds"], "best_step": trained["best"]["step"]}
        monitor.running = False  # from here on a signal may interrupt at any time: finished maps are kept
        key = self._key(row)
        predictor = self.predictor_of(row, folder.best if row.learns else None)
        maps = folder.path / f"maps-{key[:12]}"
        evaluation = evaluate_row(
            predictor,
            self.test,
            row.setting == "180",
            maps,
            lambda share: monitor.on_step(_TRAINING_SHARE + share / 10, "evaluated"),
        )
        write_json(folder.path / _RESULT, {"key": key, **result, "evaluation": evaluation})
        monitor.on_message(f"evaluated: {_summary_line(evaluation)}")

    def _key(self, row: StudyRow) -> str:
        """Return the key of weights and test set of a row."""
        best = self.folder(row).best
        return self.test.key(best.read_bytes() if best.is_file() else b"")


def _summary_line(evaluation: Mapping[str, Any]) -> str:
    """Return the main metrics of a row as text."""
    iou = [f"{name} {100 * value:.1f}" for name, value in evaluation["iou"].items() if value is not None]
    colour = evaluation["appearance_l1"]
    return ", ".join([*(["IoU " + ", ".join(iou)] if iou else []), *([] if colour is None else [f"L1 {colour:.1f}"])])


def _clear_unstarted(folder: RunFolder) -> None:
    """Remove the folder of a run that was killed before it started."""
    if not folder.path.is_dir() or folder.config.is_file():
        return
    files = list(folder.path.iterdir())
    if all(path == folder.environment or path.name.startswith((".environment-", ".config-")) for path in files):
        for path in files:
            path.unlink()
        folder.path.rmdir()


@contextmanager
def _row_progress(
    monitor: TrainingMonitor, name: str, number: int, total: int, time_is_up: Callable[[], bool]
) -> Iterator[None]:
    """Report the progress of a row as part of the study, and stop its training when the time is up."""
    on_step, on_message = monitor.on_step, monitor.on_message

    def on_row_step(share: float, text: str) -> None:
        if monitor.running and time_is_up():
            monitor.stop_requested = True
        part = share * _TRAINING_SHARE if monitor.running else share
        on_step((number + part) / total, f"{number + 1} of {total}, {name}: {text}")

    monitor.on_step, monitor.on_message = on_row_step, lambda text: on_message(f"{name}: {text}")
    try:
        yield
    finally:
        monitor.on_step, monitor.on_message, monitor.running = on_step, on_message, False
