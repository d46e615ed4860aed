"""Checks at the seams say the name, what was expected and what came."""

from __future__ import annotations

import numpy as np
import pytest

from appocc.checks import (
    check_distance,
    check_dtype,
    check_finite,
    check_intrinsic,
    check_numbers,
    check_place,
    check_shape,
    check_transform,
    frozen,
)
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


def test_places_on_earth() -> None:
    check_place("place", np.array([6.4e6, -1e7, 0.0]))
    check_place("place", np.zeros((0, 3)))
    with pytest.raises(ShapeError, match=r"^place: expected at most 1e\+09 m, got 1e\+300$"):
        check_place("place", np.array([1.0, -1e300]))
    with pytest.raises(ShapeError, match=r"^place: expected finite"):
        check_place("place", np.array([np.nan]))


def test_distances() -> None:
    for good in (None, 1e-3, 1e9):
        check_distance("--range", good)
    for wrong in (0.0, -1.0, np.inf, np.nan, 2e9):
        with pytest.raises(ShapeError, match=r"^--range: expected metres, above 0 and finite, got "):
            check_distance("--range", wrong)


def test_numbers_of_any_real_type() -> None:
    for kind in (np.bool_, np.uint8, np.int64, np.float16):
        check_numbers("x", np.zeros(2, kind))
    for wrong in (np.zeros(2, np.complex128), np.array(["1"]), np.array([{}])):
        with pytest.raises(ShapeError, match=r"^x: expected numbers, got "):
            check_numbers("x", wrong)


@pytest.mark.parametrize(
    ("matrix", "reason"),
    [
        (np.eye(4), "expected shape"),
        (np.full((3, 3), np.inf), "finite"),
        (np.diag([1.0, -2, 1]), "expected positive focal lengths, got 1 and -2"),
        (np.diag([1.0, 1, 0]), r"expected last row \[0, 0, 1\], got \[0.0, 0.0, 0.0\]"),
    ],
)
def test_what_is_no_intrinsic_matrix(matrix: np.ndarray, reason: str) -> None:
    check_intrinsic("K", np.array([[20.0, 0.1, 15], [0, 19, 9], [0, 0, 1]]))
    with pytest.raises(ShapeError, match=f"^K: .*{reason}"):
        check_intrinsic("K", matrix)


@pytest.mark.parametrize(
    ("matrix", "reason"),
    [
        (np.eye(3), "expected shape"),
        (np.diag([1e300, 1, 1, 1]), "expected a rotation matrix"),
        (np.eye(4) + np.eye(4, k=3) * 1e300, "translation: expected at most"),
        (np.full((4, 4), np.nan), "finite"),
        (np.diag([2.0, 1, 1, 1]), "expected a rotation matrix in the upper left, got one off by 3"),
        (np.diag([-1.0, 1, 1, 1]), "expected a rotation matrix"),
        (np.diag([1.0, 1, 1, 2]), r"expected last row \[0, 0, 0, 1\], got \[0.0, 0.0, 0.0, 2.0\]"),
    ],
)
def test_what_is_no_rigid_transform(matrix: np.ndarray, reason: str) -> None:
    check_transform("pose", np.eye(4))
    with pytest.raises(ShapeError, match=f"^pose.*{reason}"):
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
