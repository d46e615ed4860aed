"""Columnar files (feather, parquet) as numpy columns, read by pyarrow."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from appocc.checks import FloatArray
from appocc.errors import DataError, ShapeError
from appocc.extras import import_extra
from appocc.files import read_file
from appocc.geometry import rotation_from_quaternion

Columns = Mapping[str, NDArray[Any]]


def read_feather(path: Path, columns: Sequence[str]) -> Columns:
    """Return columns of a feather file.

    Raises:
        AppoccError: if pyarrow is not installed.
        DataError: if the file is missing or damaged, a column is missing, or a number in one is not finite.
    """
    feather, arrow = (import_extra(f"pyarrow{name}", "arrow", "reading feather") for name in (".feather", ""))
    data = read_file(path)
    try:
        table = feather.read_table(arrow.BufferReader(data), columns=list(columns), memory_map=False)
    except (arrow.ArrowException, KeyError, ValueError, OSError) as error:
        reason = str(error).splitlines()[0][:200]
        raise DataError(f"{path}: expected a feather file with {', '.join(columns)} ({reason})") from error
    return numpy_columns(path, table)


def numpy_columns(path: Path, table: Any, optional: Sequence[str] = ()) -> Columns:
    """Return the columns of an arrow table; lists are arrays, missing numbers of optional columns NaN.

    Raises:
        DataError: if a number of another column is not finite.
    """
    found = {name: np.asarray(table.column(name).to_numpy()) for name in table.column_names}
    for name, values in found.items():
        if name not in optional and values.dtype.kind == "f" and not np.isfinite(values).all():
            raise DataError(f"{path}: {name}: expected finite numbers, got some that are not")
    return found


QUATERNION = ("qw", "qx", "qy", "qz")
TRANSLATION = ("tx_m", "ty_m", "tz_m")


def poses_of(path: Path, columns: Columns) -> FloatArray:
    """Return the poses (N, 4, 4) of columns qw, qx, qy, qz, tx_m, ty_m, tz_m.

    Raises:
        DataError: if a quaternion is zero.
    """
    poses = np.tile(np.eye(4), (len(columns["qw"]), 1, 1))
    try:
        poses[:, :3, :3] = rotation_from_quaternion(np.stack([columns[name] for name in QUATERNION], axis=1))
    except ShapeError as error:
        raise DataError(f"{path}: {error}") from error
    poses[:, :3, 3] = np.stack([columns[name] for name in TRANSLATION], axis=1)
    return poses
