"""A finding about a dataset, and how findings are made from rows of a table."""

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
    """One finding.

    Attributes:
        table: the table it was found in.
        token: the row, empty where the whole table is meant.
        kind: what sort of finding it is, in few words; the same for all findings of the sort.
        reason: what is wrong with this row.
        severity: error where something cannot be used as the tables say; note where it is only incomplete.
    """

    table: str
    token: str
    kind: str
    reason: str
    severity: Severity = "error"

    def __str__(self) -> str:
        """One line: table, token, reason."""
        return f"{self.severity}: {self.table}{f' {self.token}' if self.token else ''}: {self.reason}"


def of_rows(
    table: Table, bad: BoolArray, kind: str, reason: Callable[[int], str], severity: Severity = "error"
) -> Iterator[Problem]:
    """A finding for each row of a mask (N,)."""
    for row in np.flatnonzero(bad):
        yield Problem(table.name, table.text("token", int(row)), kind, reason(int(row)), severity)


def refers(table: Table, field: str, target: str) -> Callable[[int], str]:
    """The reason of a broken reference of a row."""
    return lambda row: f"{field} '{table.text(field, row)}' is not in the table {target}"
