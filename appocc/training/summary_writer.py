"""Summary writer: metrics of a run for TensorBoard (the extra `tensorboard`)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from appocc.errors import DataError


def load_summary_writer() -> Any:
    """Import TensorBoard's `SummaryWriter` class.

    Raises:
        DataError: if TensorBoard is not installed.
    """
    try:
        from torch.utils.tensorboard import SummaryWriter
    except ImportError as error:
        raise DataError(f"save.tensorboard needs pip install '.[tensorboard]' ({error})") from error
    return SummaryWriter


class SummaryWriter:
    """Event file of a run."""

    def __init__(self, folder: Path, step: int) -> None:
        """Continue in a folder after a step; later events are purged.

        Raises:
            DataError: if TensorBoard is not installed.
        """
        self._writer = load_summary_writer()(str(folder), purge_step=step + 1)

    def add(self, line: Mapping[str, Any]) -> None:
        """Write every number of a line of metrics, with its kind as prefix."""
        for name, value in _numbers(line, line["kind"]):
            self._writer.add_scalar(name, value, line["step"])
        self._writer.flush()


def _numbers(line: Mapping[str, Any], prefix: str) -> Iterator[tuple[str, float]]:
    for key, value in line.items():
        if isinstance(value, Mapping):
            yield from _numbers(value, f"{prefix}/{key}")
        elif isinstance(value, int | float) and key != "step":
            yield f"{prefix}/{key}", float(value)
