"""The published devkit as an oracle: on real key frames both say the same."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from appocc.geometry import quaternion_from_rotation, transform
from appocc.nuscenes import Dataset
from appocc.nuscenes.records import Sample

pytestmark = pytest.mark.realdata


@pytest.fixture(scope="module")
def root(data_root: Path) -> Path:
    return data_root / "nuscenes_real"


@pytest.fixture(scope="module")
def devkit(root: Path) -> Any:
    """The devkit with the dataset open."""
    reason = "nuscenes-devkit is not installed (--no-deps)"
    devkit = pytest.importorskip("nuscenes.nuscenes", reason=reason, exc_type=ImportError)
    return devkit.NuScenes("v1.0-mini", str(root), verbose=False)


@pytest.fixture(scope="module")
def dataset(root: Path) -> Dataset:
    return Dataset(root)


def samples_of(dataset: Dataset) -> list[Sample]:
    return [sample for scene in dataset.scenes for sample in dataset.samples(scene)]


def test_scenes_samples_and_files(devkit: Any, dataset: Dataset) -> None:
    assert [s["token"] for s in devkit.scene] == [scene.token for scene in dataset.scenes]
    samples = samples_of(dataset)
    assert [s["token"] for s in devkit.sample] == [sample.token for sample in samples]
    for sample in samples:
        ours = {channel: (data.token, str(dataset.path(data))) for channel, data in dataset.data(sample).items()}
        theirs = devkit.get("sample", sample.token)["data"]
        assert ours == {channel: (token, devkit.get_sample_data_path(token)) for channel, token in theirs.items()}


def test_poses_and_intrinsics(devkit: Any, dataset: Dataset) -> None:
    for sample in samples_of(dataset):
        for data in dataset.data(sample).values():
            row = devkit.get("sample_data", data.token)
            pose = devkit.get("ego_pose", row["ego_pose_token"])
            mount = devkit.get("calibrated_sensor", row["calibrated_sensor_token"])
            for ours, theirs in ((dataset.world_from_ego_at(data), pose), (dataset.ego_from_sensor(data), mount)):
                np.testing.assert_allclose(ours, transform(theirs["rotation"], theirs["translation"]), atol=1e-9)
            if data.modality == "camera":
                np.testing.assert_array_equal(dataset.camera(data).intrinsic, mount["camera_intrinsic"])


def test_boxes_and_velocities(devkit: Any, dataset: Dataset) -> None:
    for sample in samples_of(dataset):
        boxes = dataset.boxes_world(sample)
        theirs = [devkit.get_box(token) for token in devkit.get("sample", sample.token)["anns"]]
        assert boxes.token == tuple(box.token for box in theirs)
        assert boxes.category == tuple(box.name for box in theirs)
        np.testing.assert_allclose(boxes.centre_m, [box.center for box in theirs])
        np.testing.assert_allclose(boxes.size_wlh_m, [box.wlh for box in theirs])
        np.testing.assert_allclose(boxes.rotation, [box.rotation_matrix for box in theirs], atol=1e-9)
        np.testing.assert_array_equal(boxes.velocity_mps, [devkit.box_velocity(box.token)[:2] for box in theirs])


def test_corners_are_the_same_eight_points(devkit: Any, dataset: Dataset) -> None:
    boxes = dataset.boxes_world(samples_of(dataset)[0])
    for ours, token in zip(boxes.corners(), boxes.token, strict=True):
        theirs = devkit.get_box(token).corners().T
        gaps = np.linalg.norm(ours[:, None] - theirs[None], axis=2)
        assert gaps.min(axis=1).max() < 1e-9
        assert sorted(gaps.argmin(axis=1)) == list(range(8))


def test_boxes_in_a_camera(devkit: Any, dataset: Dataset) -> None:
    """The whole chain world -> ego at the camera's own time -> camera -> pixels."""
    from nuscenes.utils.geometry_utils import view_points

    seen = 0
    for sample in samples_of(dataset):
        frame = dataset.frame(sample, images=False)
        assert frame.boxes_ego is not None
        for channel, data in dataset.data(sample).items():
            if data.modality != "camera":
                continue
            _, theirs, intrinsic = devkit.get_sample_data(data.token)
            centre = dict(zip(frame.boxes_ego.token, frame.boxes_ego.centre_m, strict=True))
            seen += len(theirs)
            for box in theirs:
                uv, depth = frame.rig[channel].project_ego(centre[box.token][None])
                expected = view_points(box.center[:, None], intrinsic, normalize=True)[:2, 0]
                assert depth[0] == pytest.approx(box.center[2], abs=1e-6)
                np.testing.assert_allclose(uv[0], expected, atol=1e-4)
    assert seen > 100


def test_tracks_over_time(devkit: Any, dataset: Dataset, tiny_devkit: tuple[Any, Dataset]) -> None:
    """Real velocities need several key frames: the made-up scene has three."""
    theirs, ours = tiny_devkit
    for sample in samples_of(ours):
        boxes = ours.boxes_world(sample)
        expected = [theirs.box_velocity(token)[:2] for token in boxes.token]
        np.testing.assert_allclose(boxes.velocity_mps, expected, atol=1e-12)
        assert np.isfinite(boxes.velocity_mps).all()


@pytest.fixture
def tiny_devkit(devkit: Any, tiny_root: Path) -> tuple[Any, Dataset]:
    """The made-up dataset, opened by both."""
    return type(devkit)("v1.0-tiny", str(tiny_root), verbose=False), Dataset(tiny_root)


def test_the_devkit_keeps_our_order_of_quaternions(devkit: Any, dataset: Dataset) -> None:
    boxes = dataset.boxes_world(samples_of(dataset)[0])
    for rotation, token in zip(boxes.rotation, boxes.token, strict=True):
        theirs = np.array(devkit.get("sample_annotation", token)["rotation"])
        np.testing.assert_allclose(quaternion_from_rotation(rotation), theirs * np.sign(theirs[0]), atol=1e-9)
