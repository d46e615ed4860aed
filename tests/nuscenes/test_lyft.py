from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from import_checks import assert_balls_in_place, assert_devkit_loads
from lyft_twin import CAR, ORIGIN, write_lyft
from PIL import Image

from appocc.doctor import examine
from appocc.errors import DataError
from appocc.geometry import apply
from appocc.nuscenes import Dataset
from appocc.nuscenes.lyft.png_window import png_window
from appocc.nuscenes.maps import mask_window


@pytest.fixture(scope="module")
def lyft(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    return Dataset(write_lyft(tmp_path_factory.mktemp("lyft") / "train"))


def test_the_published_folder_is_healthy_as_it_is(lyft: Dataset) -> None:
    report = examine(lyft.root, images=True)
    assert report.healthy
    assert {problem.kind for problem in report.problems} == {"times with fractions"}
    assert report.contents is not None
    assert (report.contents.version, report.contents.samples, report.contents.annotations) == ("data", 4, 4)
    assert set(report.contents.channels) == {
        "CAM_BACK",
        "CAM_FRONT",
        "CAM_FRONT_ZOOMED",
        "LIDAR_FRONT_LEFT",
        "LIDAR_TOP",
    }
    assert report.contents.uses == (
        "ground truth: road (mask), vehicles (boxes), colours (cameras and LiDAR)",
        "  not: lane markings (needs a vector map or labelled points)",
        "no camera looks: left, right",
    )
    assert (report.contents.masks, report.contents.scenes_with_mask) == (1, 1)


def test_pictures_boxes_and_points_are_in_place(lyft: Dataset) -> None:
    assert_balls_in_place(lyft, ORIGIN, 8)
    for sample in lyft.samples(lyft.scenes[0]):
        boxes = lyft.boxes_world(sample)
        np.testing.assert_allclose(boxes.centre_m, [ORIGIN + CAR], atol=1e-6)
        assert len(boxes.vehicles()) == 1
        for channel in ("LIDAR_TOP", "LIDAR_FRONT_LEFT"):
            data = lyft.data(sample)[channel]
            pose = lyft.world_from_ego_at(data) @ lyft.ego_from_sensor(data)
            assert boxes.inside(apply(pose, lyft.lidar(data)[:, :3])).sum() >= 38


def test_the_colours_of_the_map_are_roads_with_their_lines(lyft: Dataset) -> None:
    mask = mask_window(lyft, lyft.scenes[0], ORIGIN[:2] - 30, ORIGIN[:2] + 30)
    assert mask is not None
    assert mask.grey.shape == (600, 600)
    assert mask.source == "colours of Lyft's map"
    places = np.array([[100, 60.0], [100, 65.9], [90, 54.2], [100, 66.2], [100, 53.8], [100, 70]])
    drivable, known = mask.sample(places)
    assert drivable.tolist() == [True, True, True, False, False, False]
    assert known.all()
    assert mask_window(lyft, lyft.scenes[0], np.array([500.0, 500]), np.array([600.0, 600])) is None


def test_the_devkit_loads_it(lyft: Dataset) -> None:
    assert len(assert_devkit_loads(lyft.root, "data").sample) == 4


def test_a_cut_map_is_one_clear_line(lyft: Dataset, tmp_path: Path) -> None:
    dataset = Dataset(write_lyft(tmp_path / "train"))
    path = dataset.root / "maps/map_raster_palette.png"
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(DataError, match=r"map_raster_palette\.png: not a readable map \(expected 1200 rows"):
        mask_window(dataset, dataset.scenes[0], np.array([0.0, 0]), np.array([50.0, 50]))


@pytest.mark.parametrize("mode", ["RGB", "RGBA", "P"])
@pytest.mark.parametrize("smooth", [True, False])
def test_windows_of_pngs_are_those_of_pillow(tmp_path: Path, mode: str, smooth: bool) -> None:
    """Smooth pictures use all filters; Pillow writes the file and reads it back."""
    rng = np.random.default_rng(3)
    noise = rng.integers(0, 256, (90, 70, 3), dtype=np.uint8)
    picture = Image.fromarray(cv2.GaussianBlur(noise, (0, 0), 4) if smooth else noise).convert(mode)
    path = tmp_path / "a.png"
    picture.save(path)
    expected = np.asarray(Image.open(path).convert("RGB"))
    np.testing.assert_array_equal(png_window(path, (0, 0, 70, 90)), expected)
    np.testing.assert_array_equal(png_window(path, (5, 20, 33, 71)), expected[20:71, 5:33])


def test_other_pngs_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "grey.png"
    Image.fromarray(np.zeros((4, 4), np.uint16)).save(path)
    with pytest.raises(DataError, match="expected 8 bits of RGB or a palette"):
        png_window(path, (0, 0, 2, 2))
    path.write_bytes(b"GIF89a")
    with pytest.raises(DataError, match="expected a PNG picture"):
        png_window(path, (0, 0, 2, 2))
