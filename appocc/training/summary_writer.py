"""Metrics as TensorBoard shows them, for those who have the extra."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from appocc.errors import DataError


def summary_writer() -> Any:
    """TensorBoard's writer.

    Raises:
        DataError: if it is not installed.
    """
    try:
        from torch.utils.tensorboard import SummaryWriter
    except ImportError as error:
        raise DataError(f"save.tensorboard needs pip install 'appocc[tensorboard]' ({error})") from error
    return SummaryWriter


class Board:
    """An events file that grows with the lines of metrics."""

    def __init__(self, folder: Path, step: int) -> None:
        """Go on in a folder after a step; what was written of later ones is not shown any more.

        Raises:
            DataError: if TensorBoard is not installed.
        """
        self._writer = summary_writer()(str(folder), purge_step=step + 1)

    def add(self, line: Mapping[str, Any]) -> None:
        """Show a line of metrics: every number in it, under its kind."""
        for name, value in _numbers(line, line["kind"]):
            self._writer.add_scalar(name, value, line["step"])
        self._writer.flush()


def _numbers(line: Mapping[str, Any], under: str) -> Iterator[tuple[str, float]]:
    for key, value in line.items():
        if isinstance(value, Mapping):
            yield from _numbers(value, f"{under}/{key}")
        elif isinstance(value, int | float) and key != "step":
            yield f"{under}/{key}", float(value)
