"""Problems found by the validation of a dataset."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from appocc.checks import BoolArray
from appocc.nuscenes.table import Table

Severity = Literal["error", "note"]


@dataclass(frozen=True, slots=True)
class Problem:
    """One problem of a dataset.

    Attributes:
        table: name of the table.
        token: token of the row; empty for the whole table.
        kind: short name of the kind of problem.
        reason: description of the problem in this row.
        severity: error if data cannot be used; note if they are only incomplete.
    """

    table: str
    token: str
    kind: str
    reason: str
    severity: Severity = "error"

    def __str__(self) -> str:
        """Return one line: severity, table, token, reason."""
        return f"{self.severity}: {self.table}{f' {self.token}' if self.token else ''}: {self.reason}"


def row_problems(
    table: Table, bad: BoolArray, kind: str, reason: Callable[[int], str], severity: Severity = "error"
) -> Iterator[Problem]:
    """Yield a problem for each row of a mask (N,)."""
    for row in np.flatnonzero(bad):
        yield Problem(table.name, table.text("token", int(row)), kind, reason(int(row)), severity)


def broken_reference(table: Table, field: str, target: str) -> Callable[[int], str]:
    """Return a function that describes the broken reference of a row."""
    return lambda row: f"{field} '{table.text(field, row)}' is not in the table {target}"
