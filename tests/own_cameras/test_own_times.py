from __future__ import annotations

from pathlib import Path

import pytest

from appocc.errors import DataError
from appocc.own_cameras.times import microseconds, seconds_to_us, time_in_name


@pytest.mark.parametrize(
    ("number", "time_us"),
    [
        ("1700000000250000000", 1_700_000_000_250_000),  # ns
        ("1700000000250000", 1_700_000_000_250_000),  # us
        ("1700000000250", 1_700_000_000_250_000),  # ms
        ("1700000000", 1_700_000_000_000_000),  # s
        ("1700000000.250001", 1_700_000_000_250_001),
        ("12.5", 12_500_000),
        ("-0.25", -250_000),
        ("1.5e1", 15_000_000),
        ("1.7e9", 1_700_000_000_000_000),
        ("123", None),
    ],
)
def test_the_unit_follows_from_the_size(number: str, time_us: int | None) -> None:
    assert microseconds(number) == time_us


@pytest.mark.parametrize("number", ["", "nan", "1e400", "12:30", "1 2", "0x10"])
def test_other_texts_are_no_times(number: str) -> None:
    with pytest.raises(ValueError, match="expected a time"):
        microseconds(number)


def test_small_whole_numbers_in_tables_are_seconds() -> None:
    assert seconds_to_us("3") == 3_000_000


@pytest.mark.parametrize(
    "text", ["2023-11-14T22:13:20.250001Z", "2023-11-14 22:13:20.250001", "2023-11-14T23:13:20.250001+01:00"]
)
def test_times_of_tables_may_be_dates(text: str) -> None:
    assert seconds_to_us(text) == 1_700_000_000_250_001


@pytest.mark.parametrize("text", ["25:61", "today", "14.11.2023 22:13:20"])
def test_what_is_no_time_is_told_with_an_example(text: str) -> None:
    with pytest.raises(ValueError, match=r"or of ISO 8601, such as 1700000000.25 or 2023-11-14T22:13:20.25Z, got '"):
        seconds_to_us(text)


@pytest.mark.parametrize(
    ("name", "time_us"),
    [
        ("1700000000.25", 1_700_000_000_250_000),
        ("CAM_FRONT_1700000000250000", 1_700_000_000_250_000),
        ("n015__CAM_FRONT__1531883530412470", 1_531_883_530_412_470),
        ("frame-000030", 5_000_000 + 1_000_000),
    ],
)
def test_times_in_names(name: str, time_us: int) -> None:
    assert time_in_name(Path(name), fps=30, start_us=5_000_000) == time_us


def test_frame_numbers_need_a_rate_and_names_a_number() -> None:
    with pytest.raises(DataError, match="got a frame number; name the rate"):
        time_in_name(Path("000123"), fps=None)
    with pytest.raises(DataError, match="end of the name, got none"):
        time_in_name(Path("front"), fps=10)
