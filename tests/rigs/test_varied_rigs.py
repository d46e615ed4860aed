from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from appocc.camera import CameraRig
from appocc.rigs import read_rig, read_source_rig
from appocc.rigs.variation import FIELD_OF_VIEW_DEG, HEIGHT_M, field_of_view_deg, vary_rig, vary_source_rig
from appocc.visualization.rig_check import camera_angles


@pytest.fixture(scope="module")
def rigs() -> list[CameraRig]:
    return [vary_rig(read_rig("paper"), np.random.default_rng(seed)) for seed in range(200)]


def test_channels_and_sizes_stay(rigs: list[CameraRig]) -> None:
    for rig in rigs:
        assert [(c.channel, c.width_px, c.height_px) for c in rig] == [
            (c.channel, c.width_px, c.height_px) for c in read_rig("paper")
        ]


def test_the_same_seed_gives_the_same_rig(rigs: list[CameraRig]) -> None:
    assert vary_rig(read_rig("paper"), np.random.default_rng(3)) == rigs[3]
    assert len(set(rigs)) == len(rigs)


def test_heights_and_fields_of_view_cover_their_ranges(rigs: list[CameraRig]) -> None:
    heights = np.array([np.mean([c.ego_from_cam[2, 3] for c in rig]) for rig in rigs])
    assert HEIGHT_M[0] - 0.04 <= heights.min() < 1.4
    assert 2.1 < heights.max() <= HEIGHT_M[1] + 0.04
    views = np.array([[field_of_view_deg(c) for c in rig] for rig in rigs])
    assert FIELD_OF_VIEW_DEG[0] - 1e-9 <= views.min() < 48
    assert 115 < views.max() <= FIELD_OF_VIEW_DEG[1] + 1e-9
    # The rig changes as a whole: the side cameras, equal before, stay alike.
    assert (np.ptp(views[:, [0, 2, 3, 5]], axis=1) < 12).all()
    for rig in rigs:
        assert np.ptp([c.ego_from_cam[2, 3] for c in rig]) < 0.16


def test_angles_stay_near_those_of_the_rig(rigs: list[CameraRig]) -> None:
    for rig in rigs:
        for camera, given in zip(rig, read_rig("paper"), strict=True):
            new, old = camera_angles(camera), camera_angles(given)
            assert abs((new.yaw_deg - old.yaw_deg + 180) % 360 - 180) < 10.3
            assert abs(new.pitch_deg) <= 5.001
            assert abs(new.roll_deg) <= 1.51
            assert np.linalg.det(camera.ego_from_cam[:3, :3]) == pytest.approx(1)
            np.testing.assert_array_equal(camera.intrinsic[:2, 2], given.intrinsic[:2, 2])
            assert camera.intrinsic[0, 0] == camera.intrinsic[1, 1]


def test_pitch_is_common_to_the_rig(rigs: list[CameraRig]) -> None:
    pitches = np.array([[camera_angles(c).pitch_deg for c in rig] for rig in rigs])
    assert pitches.mean(axis=1).std() > 1.2
    assert (np.ptp(pitches, axis=1) < 4.001).all()


WIDE = """
cameras:
  nose: {size_px: [96, 72], focal_px: 30, fisheye: [0.01, 0, 0, 0], position_m: [3, 0, 0.5], yaw_deg: 0, pitch_deg: 9}
  side: {size_px: [96, 72], fov_deg: 80, distortion: [-0.2, 0.04, 0, 0], position_m: [1.8, 0.9, 1.0], yaw_deg: 70}
"""


def test_other_lenses_are_moved_and_cut_anew(tmp_path: Path) -> None:
    (tmp_path / "rig.yaml").write_text(WIDE)
    source = read_source_rig(tmp_path / "rig.yaml")
    varied = [vary_source_rig(source, np.random.default_rng(seed)) for seed in range(6)]
    for one in varied:
        assert [camera.channel for camera in one.rig] == [camera.channel for camera in source.rig]
        assert [camera.lens for camera in one.cameras] == [camera.lens for camera in source.cameras]
        assert min(camera.ego_from_cam[2, 3] for camera in one.cameras) >= 0.4
        for camera, view in ((c, v) for c in one.cameras for v in one.views if v.source == c.name):
            np.testing.assert_allclose(view.camera.ego_from_cam[:3, 3], camera.ego_from_cam[:3, 3])
    places = np.array([[camera.ego_from_cam[:3, 3] for camera in one.cameras] for one in varied])
    assert (np.ptp(places, axis=0)[:, [0, 2]] > 0.1).all(), "every camera is moved along and up"
    assert vary_source_rig(source, np.random.default_rng(3)).as_json() == varied[3].as_json()
