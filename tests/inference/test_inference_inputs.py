from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tiny_dataset import HEIGHT_PX, WIDTH_PX, TinyDataset, token

from appocc.camera import Camera, CameraRig
from appocc.ego_vehicle import EgoVehicle
from appocc.errors import DataError
from appocc.files import write_image, write_json
from appocc.geometry import apply, inverse
from appocc.inference.inputs import dataset_inputs, folder_inputs
from appocc.nuscenes import Dataset
from appocc.nuscenes.lidar import write_lidar
from appocc.rigs import SourceRig, read_source_rig

RIG = SourceRig.of_pinholes(
    CameraRig(
        tuple(
            Camera(name, 16, 8, np.diag([10.0, 10, 1]), np.eye(4)) for name in ("CAM_FRONT", "CAM_BACK", "CAM_LEFT")
        )
    )
)
GREY = np.full((8, 16, 3), 90, np.uint8)


def test_the_samples_of_a_dataset(tiny: TinyDataset) -> None:
    dataset = Dataset(tiny.root)
    inputs = dataset_inputs(dataset, dataset.scenes)
    assert [each.token for each in inputs] == [token("sample", i) for i in range(3)]
    assert inputs[1].title == "scene-tiny-0001"
    frame, missing = inputs[1].read()
    assert dict(missing) == {}
    assert frame.images["CAM_BACK"].shape == (HEIGHT_PX, WIDTH_PX, 3)
    # 10 ms before the sample the ego stood 5 cm farther back.
    assert frame.rig["CAM_FRONT"].ego_from_cam[0, 3] == pytest.approx(1.45)
    with pytest.raises(DataError, match="no key frames"):
        dataset_inputs(dataset, [])


def test_missing_damaged_and_black_images_are_dead_cameras(tiny: TinyDataset) -> None:
    dataset = Dataset(tiny.root)
    first, second = dataset.samples(dataset.scenes[0])[:2]
    path = dataset.path(dataset.data(first)["CAM_BACK"])
    path.unlink()
    broken = dataset.path(dataset.data(second)["CAM_FRONT"])
    broken.write_bytes(broken.read_bytes()[:-3])
    write_image(dataset.path(dataset.data(second)["CAM_BACK"]), np.zeros((HEIGHT_PX, WIDTH_PX, 3), np.uint8))
    inputs = dataset_inputs(dataset, dataset.scenes)
    frame, missing = inputs[0].read()
    assert set(frame.images) == {"CAM_FRONT"}
    assert str(path) in missing["CAM_BACK"]
    frame, missing = inputs[1].read()
    assert not frame.images
    assert "truncated" in missing["CAM_FRONT"]
    assert "is black" in missing["CAM_BACK"]


def write_ground(dataset: Dataset, number: int, slope: float) -> Path:
    """Let the LiDAR of a sample see ground that rises to the left; return its file."""
    sweep = dataset.data(dataset.samples(dataset.scenes[0])[number])["LIDAR_TOP"]
    x, y = (axis.ravel() for axis in np.meshgrid(np.arange(-25.0, 25.0, 0.5), np.arange(-25.0, 25.0, 0.5)))
    points = apply(inverse(dataset.ego_from_sensor(sweep)), np.column_stack([x, y, slope * y]))
    write_lidar(dataset.path(sweep), np.column_stack([points, np.zeros((len(points), 2))]))
    return dataset.path(sweep)


def test_frames_are_level_with_the_ground_that_the_lidar_sees(tiny: TinyDataset) -> None:
    dataset = Dataset(tiny.root)
    write_ground(dataset, 0, 0.035)
    write_ground(dataset, 1, 0.0)
    tilted, flat, sparse = dataset_inputs(dataset, dataset.scenes)
    pose = tilted.read().frame.ego_from_level
    assert pose is not None
    np.testing.assert_allclose(pose[:3, 2], [0, -0.035, 1], atol=1e-3)
    assert flat.read().frame.ego_from_level is None
    assert sparse.read().frame.ego_from_level is None  # three points tell nothing


def test_a_changed_sweep_changes_a_map_unless_frames_are_not_levelled(tiny: TinyDataset) -> None:
    dataset = Dataset(tiny.root)
    first = {level: dataset_inputs(dataset, dataset.scenes, level)[0] for level in (True, False)}
    before = {level: each.parts() for level, each in first.items()}
    path = write_ground(dataset, 0, 0.035)
    assert first[True].parts() != before[True]
    assert first[False].parts() == before[False]
    assert first[False].read().frame.ego_from_level is None
    path.unlink()
    assert first[True].read().frame.ego_from_level is None
    path.write_bytes(b"\0" * 7)
    with pytest.raises(DataError, match=path.name):
        first[True].read()


def test_a_folder_of_images(tmp_path: Path) -> None:
    write_image(tmp_path / "CAM_FRONT.png", GREY)
    write_image(tmp_path / "CAM_BACK.JPG", GREY)
    write_image(tmp_path / "holiday.png", GREY)
    (each,) = folder_inputs(tmp_path, RIG)
    assert each.token == tmp_path.name
    frame, missing = each.read()
    assert set(frame.images) == {"CAM_FRONT", "CAM_BACK"}
    assert dict(missing) == {"CAM_LEFT": "no image"}


def test_a_larger_vehicle_is_another_calibration(tmp_path: Path) -> None:
    write_image(tmp_path / "CAM_FRONT.png", GREY)
    bus = replace(RIG, ego_vehicle=EgoVehicle(length_m=12.0))
    same, other = (folder_inputs(tmp_path, rig)[0].parts() for rig in (replace(RIG), bus))
    assert same == folder_inputs(tmp_path, RIG)[0].parts()
    assert (same["pictures"], same["calibration"] == other["calibration"]) == (other["pictures"], False)


def test_a_folder_of_frames_in_order_of_their_names(tmp_path: Path) -> None:
    for name in ("0002", "0001", "empty"):
        (tmp_path / name).mkdir()
    for name in ("0001", "0002"):
        write_image(tmp_path / name / "CAM_LEFT.png", GREY)
    inputs = folder_inputs(tmp_path, RIG)
    assert [each.token for each in inputs] == ["0001", "0002"]
    assert set(inputs[0].read().frame.images) == {"CAM_LEFT"}


WIDE = """
cameras:
  nose: {size_px: [160, 120], fov_deg: 190, fisheye: [0, 0, 0, 0], position_m: [3, 0, 1], yaw_deg: 0, pitch_deg: 20}
"""


def test_pictures_of_a_wide_lens_are_found_by_its_name_and_cut(tmp_path: Path) -> None:
    (tmp_path / "rig.yaml").write_text(WIDE)
    write_image(tmp_path / "nose.png", np.full((120, 160, 3), 90, np.uint8))
    rig = read_source_rig(tmp_path / "rig.yaml")
    (each,) = folder_inputs(tmp_path, rig)
    frame, missing = each.read()
    assert (set(frame.images), dict(missing)) == ({"CAM_NOSE_1", "CAM_NOSE_2"}, {})
    assert frame.rig == rig.rig
    (tmp_path / "nose.png").unlink()
    write_image(tmp_path / "CAM_NOSE_1.png", GREY)
    with pytest.raises(DataError, match=r"named by the cameras of the rig \(nose.jpg, ...\), .* got none"):
        folder_inputs(tmp_path, rig)


def test_another_lens_is_another_calibration(tmp_path: Path) -> None:
    write_image(tmp_path / "nose.png", np.full((120, 160, 3), 90, np.uint8))
    parts = []
    for text in (
        WIDE,
        WIDE,
        WIDE.replace("[0, 0, 0, 0]", "[0.01, 0, 0, 0]"),
        WIDE.replace("pitch_deg: 20", "pitch_deg: 21"),
    ):
        (tmp_path / "rig.yaml").write_text(text)
        parts.append(folder_inputs(tmp_path, read_source_rig(tmp_path / "rig.yaml"))[0].parts()["calibration"])
    assert parts[0] == parts[1]
    assert len(set(parts)) == 3


def test_pictures_of_another_size_are_told_once_for_all_frames(tmp_path: Path) -> None:
    for name in ("0001", "0002"):
        (tmp_path / name).mkdir()
        write_image(tmp_path / name / "CAM_LEFT.png", np.full((16, 32, 3), 90, np.uint8))
    told: list[str] = []
    for each in folder_inputs(tmp_path, RIG, told.append):
        assert each.read().frame.images["CAM_LEFT"].shape == (8, 16, 3)
    assert told == ["CAM_LEFT: expected 16x8 pixels, as size_px of its rig says, got 32x16; pictures are scaled"]


def test_folders_that_do_not_fit(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="no such folder"):
        folder_inputs(tmp_path / "none", RIG)
    with pytest.raises(DataError, match=r"named by the cameras of the rig \(CAM_FRONT.jpg.* appocc convert"):
        folder_inputs(tmp_path, RIG)
    write_json(tmp_path / "data" / "v1.0-mini" / "sample_data.json", [])
    with pytest.raises(DataError, match="a dataset has its own rig: leave out --rig"):
        folder_inputs(tmp_path / "data", RIG)
    write_image(tmp_path / "CAM_FRONT.png", GREY[:4])
    with pytest.raises(DataError, match="expected 16x8 pixels, as size_px of its rig says, got 16x4"):
        folder_inputs(tmp_path, RIG)[0].read()
    write_image(tmp_path / "CAM_FRONT.jpg", GREY)
    with pytest.raises(DataError, match="expected one image of CAM_FRONT"):
        folder_inputs(tmp_path, RIG)
