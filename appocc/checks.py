"""Validation of values at module boundaries: every error names the value, the expected and the actual one."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from appocc.errors import ShapeError

FloatArray = NDArray[np.float64]
Float32Array = NDArray[np.float32]
IntArray = NDArray[np.int64]
ByteArray = NDArray[np.uint8]
BoolArray = NDArray[np.bool_]
# Map projections count up to 1e7 m; far beyond, squares overflow.
FARTHEST_M = 1e9


def check_shape(name: str, array: NDArray[np.generic], expected: tuple[int | None, ...]) -> None:
    """Check the shape of an array; `None` in `expected` means any size.

    Raises:
        ShapeError: if the number of axes or a size differs.
    """
    fits = array.shape == expected or (
        array.ndim == len(expected)
        and all(want in (None, got) for want, got in zip(expected, array.shape, strict=True))
    )
    if not fits:
        wanted = ", ".join("any" if size is None else str(size) for size in expected)
        raise ShapeError(f"{name}: expected shape ({wanted}), got {array.shape}")


def check_dtype(name: str, array: NDArray[np.generic], expected: type[np.generic]) -> None:
    """Check the element type of an array.

    Raises:
        ShapeError: if the type differs.
    """
    if array.dtype != np.dtype(expected):
        raise ShapeError(f"{name}: expected {np.dtype(expected)}, got {array.dtype}")


def check_finite(name: str, array: NDArray[np.generic]) -> None:
    """Check that an array holds neither NaN nor infinity.

    Raises:
        ShapeError: if it does.
    """
    bad = int(np.size(array) - np.count_nonzero(np.isfinite(np.asarray(array, dtype=np.float64))))
    if bad:
        raise ShapeError(f"{name}: expected finite numbers, got {bad} of {np.size(array)} that are not")


def as_array(name: str, values: ArrayLike, dtype: type[np.generic] = np.float64) -> NDArray[Any]:
    """Return a copy of an array, or of lists of numbers, as an array of a type.

    Raises:
        ShapeError: if they are no numbers.
    """
    try:
        return np.array(values, dtype=dtype, order="C")
    except (TypeError, ValueError) as error:
        raise ShapeError(f"{name}: expected an array of numbers ({error})") from error


def check_place(name: str, array: NDArray[np.generic]) -> None:
    """Check coordinates in metres: finite and at most FARTHEST_M from the origin.

    Raises:
        ShapeError: if one is not.
    """
    check_finite(name, array)
    far = float(np.abs(array).max(initial=0.0))
    if far > FARTHEST_M:
        raise ShapeError(f"{name}: expected at most {FARTHEST_M:.0e} m, got {far:.2g}")


def check_distance(name: str, value_m: float | None) -> None:
    """Check an optional distance in metres: positive and at most FARTHEST_M.

    Raises:
        ShapeError: if it is not.
    """
    if value_m is not None and not 0 < value_m <= FARTHEST_M:
        raise ShapeError(f"{name}: expected metres, above 0 and finite, got {value_m:g}")


def check_numbers(name: str, array: NDArray[np.generic]) -> None:
    """Check that an array holds real numbers (or booleans), of any type.

    Raises:
        ShapeError: if it holds texts, objects or complex numbers.
    """
    if array.dtype.kind not in "buif":
        raise ShapeError(f"{name}: expected numbers, got {array.dtype}")


def check_intrinsic(name: str, matrix: NDArray[np.generic]) -> None:
    """Check that a matrix is a pinhole camera's K: (3, 3), finite, positive focal lengths, last row 0 0 1.

    Raises:
        ShapeError: if it is not.
    """
    check_shape(name, matrix, (3, 3))
    check_finite(name, matrix)
    k = np.asarray(matrix, dtype=np.float64)
    if k[0, 0] <= 0 or k[1, 1] <= 0:
        raise ShapeError(f"{name}: expected positive focal lengths, got {k[0, 0]:g} and {k[1, 1]:g}")
    if not np.allclose(k[2], [0, 0, 1]):
        raise ShapeError(f"{name}: expected last row [0, 0, 1], got {k[2].tolist()}")


def check_transform(name: str, matrix: NDArray[np.generic]) -> None:
    """Check that a matrix is a rigid transform: (4, 4), finite, orthonormal rotation, last row 0 0 0 1.

    Raises:
        ShapeError: if it is not (rotation off by more than 1e-3).
    """
    check_shape(name, matrix, (4, 4))
    # Plain arithmetic is faster than numpy for sixteen numbers.
    *turn, last = np.asarray(matrix, dtype=np.float64).tolist()
    if not math.isfinite(sum(map(sum, turn), sum(last))):
        check_finite(name, matrix)
    x, y, z = (row[:3] for row in turn)
    pairs = (x, x, 1), (y, y, 1), (z, z, 1), (x, y, 0), (x, z, 0), (y, z, 0)
    off = max([abs(_dot(p, q) - product) for p, q, product in pairs])
    if off > 1e-3:
        raise ShapeError(f"{name}: expected a rotation matrix in the upper left, got one off by {off:.2g}")
    if _dot(_cross(x, y), z) < 0:
        raise ShapeError(f"{name}: expected a rotation matrix in the upper left, got a mirror: one axis is reversed")
    if any(abs(got - want) > 1e-5 for got, want in zip(last, (0, 0, 0, 1), strict=True)):
        raise ShapeError(f"{name}: expected last row [0, 0, 0, 1], got {last}")
    if max(abs(row[3]) for row in turn) > FARTHEST_M:
        check_place(f"{name} translation", matrix[:3, 3])


def _dot(p: list[float], q: list[float]) -> float:
    return p[0] * q[0] + p[1] * q[1] + p[2] * q[2]


def _cross(p: list[float], q: list[float]) -> list[float]:
    return [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]]


def frozen(array: NDArray[np.generic]) -> None:
    """Make an array read-only in place; for arrays that the caller does not hold."""
    array.flags.writeable = False


def freeze_arrays(value: object, *names: str) -> None:
    """Replace array fields of a frozen dataclass by read-only copies, for use in `__post_init__`.

    The caller's arrays stay writeable and independent of the dataclass. An array that is read-only down to its
    memory is shared and not copied.
    """
    for name in names:
        array = getattr(value, name)
        if not _is_read_only(array):
            array = np.array(array)
            array.flags.writeable = False
            object.__setattr__(value, name, array)


def _is_read_only(array: NDArray[np.generic]) -> bool:
    """Whether neither an array nor the memory that it is a view of can be written."""
    memory: object = array
    while isinstance(memory, np.ndarray):
        if memory.flags.writeable:
            return False
        memory = memory.base
    return memory is None or isinstance(memory, bytes)
