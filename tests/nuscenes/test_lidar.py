"""LiDAR files and their labels."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from appocc.errors import DataError, ShapeError
from appocc.nuscenes.lidar import read_labels, read_lidar, write_lidar

POINTS = np.array([[1.5, -2, 0.25, 100, 3], [0, 0, 0, 0, 31]])


def test_points_there_and_back(tmp_path: Path) -> None:
    write_lidar(tmp_path / "LIDAR_TOP" / "a.pcd.bin", POINTS)
    assert (tmp_path / "LIDAR_TOP" / "a.pcd.bin").stat().st_size == 40
    np.testing.assert_array_equal(read_lidar(tmp_path / "LIDAR_TOP" / "a.pcd.bin"), POINTS)


def test_points_of_another_shape_are_not_written(tmp_path: Path) -> None:
    with pytest.raises(ShapeError, match=r"lidar points: expected shape \(any, 5\), got \(2, 4\)"):
        write_lidar(tmp_path / "a.bin", POINTS[:, :4])
    assert not list(tmp_path.iterdir())


def test_points_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"none\.bin: cannot be read"):
        read_lidar(tmp_path / "none.bin")
    (tmp_path / "half.bin").write_bytes(bytes(30))
    with pytest.raises(DataError, match=r"half\.bin: expected rows of 5 float32 \(20 bytes\), got 30 bytes"):
        read_lidar(tmp_path / "half.bin")


def test_points_that_are_all_no_numbers(tmp_path: Path) -> None:
    (tmp_path / "nan.bin").write_bytes(np.full((7, 5), np.nan, np.float32).tobytes())
    with pytest.raises(DataError, match=r"nan\.bin: expected finite points, got 7 that are not"):
        read_lidar(tmp_path / "nan.bin")
    some = np.array([[np.nan, 0, 0, 0, 0], [1, 2, 3, np.nan, 0]], np.float32)
    (tmp_path / "some.bin").write_bytes(some.tobytes())
    assert read_lidar(tmp_path / "some.bin")[1, :3].tolist() == [1, 2, 3]
    (tmp_path / "empty.bin").write_bytes(b"")
    assert read_lidar(tmp_path / "empty.bin").shape == (0, 5)


def test_labels_are_one_byte_a_point(tmp_path: Path) -> None:
    (tmp_path / "a.bin").write_bytes(bytes([24, 17]))
    assert read_labels(tmp_path / "a.bin", 2).tolist() == [24, 17]
    with pytest.raises(DataError, match=r"a\.bin: expected 3 labels, one per point, got 2"):
        read_labels(tmp_path / "a.bin", 3)
    with pytest.raises(DataError, match=r"none\.bin: cannot be read"):
        read_labels(tmp_path / "none.bin", 2)
