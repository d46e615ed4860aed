from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from made_kitti import made_kitti, write

from appocc.errors import DataError
from tracking.io.kitti import read_sequences

EQUATOR_M_PER_DEGREE = np.pi * 6378137.0 / 180
# The axes of the camera from those of LiDAR and IMU, at one place: x ahead, y left, z up.
TRANSFORMS = (
    "R_rect 1 0 0 0 1 0 0 0 1",
    "Tr_velo_cam 0 -1 0 0 0 0 -1 0 1 0 0 0",
    "Tr_imu_velo 1 0 0 0 0 1 0 0 0 0 1 0",
)


def own_layout(root: Path, latitude: float = 0.0) -> Path:
    """A car drives east by a metre per frame, then looks north."""
    made_kitti(root)
    (root / "label").rename(root / "label_02")
    shutil.rmtree(root / "pose")
    calib = root / "calib" / "0001.txt"
    write(calib, [*calib.read_text().splitlines(), *TRANSFORMS])
    metre = 1 / EQUATOR_M_PER_DEGREE / np.cos(np.radians(latitude))
    write(
        root / "oxts" / "0001.txt",
        [f"{latitude} {8 + i * metre} 100 0 0 {0 if i < 2 else np.pi / 2} 0" for i in range(3)],
    )
    return root


@pytest.mark.parametrize("latitude", [0.0, 49.0])
def test_kittis_own_layout(tmp_path: Path, latitude: float) -> None:
    (sequence,) = read_sequences(own_layout(tmp_path, latitude))
    assert sequence.labels is not None
    poses = np.array([frame.world_from_ego for frame in sequence.frames])
    np.testing.assert_allclose(poses[:, :3, 3], [[0, 0, 0], [1, 0, 0], [2, 0, 0]], atol=1e-6)
    np.testing.assert_allclose(poses[0], np.eye(4), atol=1e-9)
    np.testing.assert_allclose(poses[2, :3, 0], [0, 1, 0], atol=1e-9)


def test_without_its_calibration_oxts_is_no_pose(tmp_path: Path) -> None:
    root = own_layout(tmp_path)
    calib = root / "calib" / "0001.txt"
    write(calib, calib.read_text().splitlines()[:-1])
    with pytest.raises(DataError, match="expected a line Tr_imu_velo, got none"):
        read_sequences(root)
