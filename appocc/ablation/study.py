"""The study: each row is trained, judged and told, then the tables are written; it goes on where it was ended."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from appocc.ablation.judging import JudgingSet, Maker, judge
from appocc.ablation.result import read_result
from appocc.ablation.rows import Row
from appocc.errors import DataError
from appocc.files import write_json
from appocc.training.checkpoint import list_checkpoints
from appocc.training.config import Config
from appocc.training.run import StoppedError, TrainingError, TrainingMonitor
from appocc.training.run_folder import RunFolder

_RESULT = "result.json"
_TRAINED = 0.9  # share of a row's bar that training takes


class Train(Protocol):
    """Trains as a configuration says, in a run's folder: see `session.run_training`."""

    def __call__(
        self, config: Config, folder: RunFolder, resume: bool, monitor: TrainingMonitor
    ) -> Mapping[str, Any]:
        """What came of it."""
        ...


class Outcome(NamedTuple):
    """How far a row has come.

    Attributes:
        row: which.
        state: done; failed (the training diverged); begun; not run.
        result: what its `result.json` says: `steps`, `best_step`, `seconds` and `evaluation` of one that is done,
            the `reason` of one that failed; empty of others, but for the `steps` of one that is begun.
    """

    row: Row
    state: str
    result: Mapping[str, Any]


@dataclass(frozen=True)
class Study:
    """All that a study is made of.

    Attributes:
        base: the configuration that all rows share.
        rows: all of them, in their order.
        test: what they are judged on.
        out: folder of everything.
        train: trains a row.
        maker_of: maps of a row, from its weights (None: it learnt nothing).
        write: writes the tables of all outcomes.
    """

    base: Config
    rows: Sequence[Row]
    test: JudgingSet
    out: Path
    train: Train
    maker_of: Callable[[Row, Path | None], Maker]
    write: Callable[[Study, Sequence[Outcome]], None]

    def check(self) -> None:
        """Check what can be checked before anything is begun.

        Raises:
            DataError: if the test set cannot be used, or the folder holds another study.
        """
        if int(os.environ.get("WORLD_SIZE", "1")) > 1:
            raise DataError("ablate: expected one process, got several (torchrun); share the rows out with --only")
        self.test.check()
        for row in self.rows:
            folder = self.folder(row)
            if row.learns and folder.config.is_file():
                folder.check(row.config(self.base), resume=True)

    def folder(self, row: Row) -> RunFolder:
        """Where a row is trained."""
        return RunFolder(self.out / row.name)

    def run(self, chosen: Sequence[Row], monitor: TrainingMonitor, time_is_up: Callable[[], bool]) -> list[Outcome]:
        """Bring the chosen rows to their end, as far as there is time; the outcomes of all rows.

        The tables are written before, and after each row. A row under way when the time is up keeps its state.

        Raises:
            AppoccError: if data are missing or damaged, or the folder cannot be written.
            StoppedError: if the monitor asked for it.
        """
        self.write(self, self.outcomes())
        for number, row in enumerate(chosen):
            if time_is_up():
                break
            if self._outcome(row).state in ("done", "failed"):
                continue
            try:
                with _telling(monitor, row.name, number, len(chosen), time_is_up):
                    self._finish(row, monitor)
            except StoppedError:
                if not time_is_up():
                    raise
                break
            finally:
                self.write(self, self.outcomes())
        return self.outcomes()

    def outcomes(self) -> list[Outcome]:
        """How far every row has come, as their folders say."""
        return [self._outcome(row) for row in self.rows]

    def _outcome(self, row: Row) -> Outcome:
        folder = self.folder(row)
        there = folder.path / _RESULT
        if there.is_file():
            result = read_result(there, self._key(row))
            if result is not None:
                return Outcome(row, "failed" if "reason" in result else "done", result)
        if not folder.config.is_file():
            return Outcome(row, "not run", {})
        reached = list_checkpoints(folder.path)
        return Outcome(row, "begun", {"steps": int(reached[0].stem.partition("-")[2]) if reached else 0})

    def _finish(self, row: Row, monitor: TrainingMonitor) -> None:
        """Train, judge and write the result; what is done already is not done again."""
        folder = self.folder(row)
        result: dict[str, Any] = {}
        if row.learns:
            _clear(folder)
            try:
                trained = self.train(row.config(self.base), folder, folder.path.exists(), monitor)
            except TrainingError as error:
                write_json(folder.path / _RESULT, {"key": self._key(row), "reason": str(error)})
                monitor.on_message(str(error))
                return
            result = {"steps": trained["steps"], "seconds": trained["seconds"], "best_step": trained["best"]["step"]}
        monitor.running = False  # from here on a signal may end it at once: maps that are made are kept
        key = self._key(row)
        maker = self.maker_of(row, folder.best if row.learns else None)
        maps = folder.path / f"maps-{key[:12]}"
        evaluation = judge(
            maker,
            self.test,
            row.setting == "180",
            maps,
            lambda share: monitor.on_step(_TRAINED + share / 10, "judged"),
        )
        write_json(folder.path / _RESULT, {"key": key, **result, "evaluation": evaluation})
        monitor.on_message(f"judged: {_line(evaluation)}")

    def _key(self, row: Row) -> str:
        """Changes with the weights of a row and with the test set."""
        best = self.folder(row).best
        return self.test.key(best.read_bytes() if best.is_file() else b"")


def _line(evaluation: Mapping[str, Any]) -> str:
    """The main figures of a row, for people."""
    iou = [f"{name} {100 * value:.1f}" for name, value in evaluation["iou"].items() if value is not None]
    colour = evaluation["appearance_l1"]
    return ", ".join([*(["IoU " + ", ".join(iou)] if iou else []), *([] if colour is None else [f"L1 {colour:.1f}"])])


def _clear(folder: RunFolder) -> None:
    """Remove a folder in which a run was about to begin when it was killed."""
    if not folder.path.is_dir() or folder.config.is_file():
        return
    left = list(folder.path.iterdir())
    if all(path == folder.environment or path.name.startswith((".environment-", ".config-")) for path in left):
        for path in left:
            path.unlink()
        folder.path.rmdir()


@contextmanager
def _telling(
    monitor: TrainingMonitor, name: str, number: int, total: int, time_is_up: Callable[[], bool]
) -> Iterator[None]:
    """Let the monitor hear of a row as of a part of the study, and stop its training when the time is up."""
    step, say = monitor.on_step, monitor.on_message

    def told(share: float, text: str) -> None:
        if monitor.running and time_is_up():
            monitor.stop_requested = True
        part = share * _TRAINED if monitor.running else share
        step((number + part) / total, f"{number + 1} of {total}, {name}: {text}")

    monitor.on_step, monitor.on_message = told, lambda text: say(f"{name}: {text}")
    try:
        yield
    finally:
        monitor.on_step, monitor.on_message, monitor.running = step, say, False
