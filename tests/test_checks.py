"""Checks at the seams say the name, what was expected and what came."""

from __future__ import annotations

import numpy as np
import pytest

from appocc.checks import check_dtype, check_finite, check_shape, check_transform, frozen
from appocc.errors import AppoccError, DataError, NotFoundError, ShapeError


def test_shapes_may_leave_an_axis_open() -> None:
    check_shape("points", np.zeros((7, 3)), (None, 3))
    with pytest.raises(ShapeError, match=r"^points: expected shape \(any, 3\), got \(7, 2\)$"):
        check_shape("points", np.zeros((7, 2)), (None, 3))
    with pytest.raises(ShapeError, match=r"got \(3,\)"):
        check_shape("points", np.zeros(3), (None, 3))


def test_types() -> None:
    check_dtype("image", np.zeros(2, np.uint8), np.uint8)
    with pytest.raises(ShapeError, match=r"^image: expected uint8, got float64$"):
        check_dtype("image", np.zeros(2), np.uint8)


def test_finite_counts_what_is_not() -> None:
    check_finite("x", np.zeros(3))
    with pytest.raises(ShapeError, match=r"^x: expected finite numbers, got 2 of 3 that are not$"):
        check_finite("x", np.array([np.nan, 1.0, np.inf]))


@pytest.mark.parametrize(
    ("matrix", "reason"),
    [
        (np.eye(3), "expected shape"),
        (np.full((4, 4), np.nan), "finite"),
        (np.diag([2.0, 1, 1, 1]), "expected a rotation matrix in the upper left, got one off by 3"),
        (np.diag([-1.0, 1, 1, 1]), "expected a rotation matrix"),
        (np.diag([1.0, 1, 1, 2]), r"expected last row \[0, 0, 0, 1\], got \[0.0, 0.0, 0.0, 2.0\]"),
    ],
)
def test_what_is_no_rigid_transform(matrix: np.ndarray, reason: str) -> None:
    check_transform("pose", np.eye(4))
    with pytest.raises(ShapeError, match=f"^pose: .*{reason}"):
        check_transform("pose", matrix)


def test_frozen_arrays_cannot_be_written() -> None:
    array = np.zeros(2)
    frozen(array)
    with pytest.raises(ValueError, match="read-only"):
        array[0] = 1


@pytest.mark.parametrize("error", [ShapeError, DataError, NotFoundError])
def test_every_error_of_the_suite_ends_with_exit_code_2(error: type[AppoccError]) -> None:
    assert issubclass(error, AppoccError)
    assert error("x").exit_code == 2
