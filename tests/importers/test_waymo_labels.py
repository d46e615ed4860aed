"""Panoptic labels of Waymo's pictures become pixel classes in their place, in both layouts."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from typer.testing import CliRunner
from waymo_street import CAMERAS, DISTORTION, DIVISOR, LABELLED, NAME, SIZE, K, label_image, panoptic_png
from waymo_twin import Records, write_components

from appocc.doctor import contents_of
from appocc.errors import DataError
from appocc.importers import Summary, import_logs
from appocc.importers.waymo import find_logs
from appocc.importers.waymo.panoptic import kinds_of
from appocc.importers.waymo.segment import PanopticLabel
from appocc.nuscenes import Dataset
from appocc.nuscenes.validate import validate
from appocc.nuscenes.view_targets import ViewClass, load_view_targets, view_targets_path
from cli.convert import app

LAYOUTS = ("v1", "v2")
CHANNELS = {1: "CAM_FRONT", 4: "CAM_SIDE_LEFT", 5: "CAM_SIDE_RIGHT"}
FRAMES = 3
UNKNOWN = 255
# Number of a type in camera_segmentation.proto, and its class here.
KINDS = {0: UNKNOWN, 2: ViewClass.VEHICLE, 20: ViewClass.ROAD, 21: ViewClass.LANE_MARKING, 25: ViewClass.SKY}
LABEL = "[CameraSegmentationLabelComponent].panoptic_label"


def convert(src: Path, out: Path) -> Summary:
    return import_logs(find_logs(src, 10.0), out, "waymo", {})


@pytest.fixture(scope="module")
def sources(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("labels")
    Records().write(root / "v1/training", FRAMES)
    write_components(root / "v2/training", FRAMES)
    return root


@pytest.fixture(scope="module")
def converted(sources: Path) -> dict[str, Dataset]:
    for layout in LAYOUTS:
        summary = convert(sources / layout, sources / f"out-{layout}")
        assert (summary.images, summary.pixel_classes, summary.missing) == (3 * FRAMES, len(LABELLED), {})
    return {layout: Dataset(sources / f"out-{layout}") for layout in LAYOUTS}


def views_of(dataset: Dataset, frame: int) -> dict[str, np.ndarray]:
    """The classes of a key frame by channel; none if it has no file."""
    path = view_targets_path(dataset.root, dataset.samples(dataset.scenes[0])[frame].token)
    views = load_view_targets(path) if path.is_file() else {}
    assert all(view.depth_m is None for view in views.values())
    return {channel: view.kind for channel, view in views.items()}


# In place ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("layout", LAYOUTS)
def test_a_block_has_the_class_of_the_pixels_that_its_picture_shows_there(
    converted: dict[str, Dataset], layout: str
) -> None:
    dataset, seen = converted[layout], set[int]()
    for frame, sample in enumerate(dataset.samples(dataset.scenes[0])):
        views = views_of(dataset, frame)
        assert set(views) == {CHANNELS[camera] for at, camera in LABELLED if at == frame}
        rig = dataset.frame(sample, images=False).rig
        for number, channel in CHANNELS.items():
            if channel in views:
                camera = rig[channel]
                # Where the lens has put each pixel of the rectified picture, by OpenCV's formula.
                v, u = np.mgrid[: camera.height_px, : camera.width_px]
                pixels = np.stack([u, v, np.ones_like(u)], axis=-1).reshape(-1, 3)
                rays = pixels @ np.linalg.inv(camera.intrinsic).T
                source = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), K, DISTORTION)[0].reshape(-1, 2)
                column, row = source.round().astype(int).clip(0, np.array(SIZE) - 1).T
                types = label_image(number, 0.1 * frame + CAMERAS[number][2])[row, column].reshape(u.shape)
                for (i, j), kind in np.ndenumerate(views[channel]):
                    block = types[8 * i : 8 * i + 8, 8 * j : 8 * j + 8]
                    if len(np.unique(block)) == 1:
                        assert kind == KINDS[int(block[0, 0])], (channel, i, j)
                        seen.add(int(block[0, 0]))
                    else:
                        assert kind in {KINDS[int(each)] for each in block.ravel()}
    assert seen == set(KINDS)


def test_both_layouts_have_the_same_classes(converted: dict[str, Dataset]) -> None:
    one, other = (converted[layout] for layout in LAYOUTS)
    for frame in range(FRAMES):
        first, second = views_of(one, frame), views_of(other, frame)
        assert first.keys() == second.keys()
        for channel, kind in first.items():
            np.testing.assert_array_equal(kind, second[channel])


def test_the_result_is_healthy_and_doctor_counts_the_labelled_pictures(converted: dict[str, Dataset]) -> None:
    for dataset in converted.values():
        assert list(validate(dataset, images=True)) == []
        assert contents_of(dataset).pixel_classes == len(LABELLED)


@pytest.mark.parametrize("divisor", [1, 1000, 2000])
def test_every_type_has_a_class_or_is_not_labelled(divisor: int) -> None:
    """Types in the order of camera_segmentation.proto; what comes after them is a type of a later version."""
    names = [None, None, *["VEHICLE"] * 4, *["TWO_WHEELER"] * 2, "VEHICLE", "PERSON", *["TWO_WHEELER"] * 2]
    names += [*["OTHER"] * 3, "POLE_OR_SIGN", "OTHER", *["POLE_OR_SIGN"] * 2, "BUILDING", "ROAD", "LANE_MARKING"]
    names += ["ROAD", "PAVEMENT", "VEGETATION", "SKY", "TERRAIN", "OTHER", "OTHER", None, None]
    label = np.arange(31, dtype=np.uint16)[None] * divisor + np.arange(2, dtype=np.uint16)[:, None] * (divisor - 1)
    found = kinds_of("label", PanopticLabel(cv2.imencode(".png", label)[1].tobytes(), divisor), (31, 2))
    assert found.dtype == np.uint8
    assert found.tolist() == [[UNKNOWN if name is None else ViewClass[name] for name in names]] * 2


# Damage -----------------------------------------------------------------------------------------------------------


def grey(kind: Any, size: tuple[int, int] = SIZE) -> bytes:
    return bytes(cv2.imencode(".png", np.full(size[::-1], 20, kind))[1].tobytes())


def _cut(label: Any) -> None:
    label.panoptic_label = label.panoptic_label[:-40]


def _flipped(label: Any) -> None:
    half = len(label.panoptic_label) // 2
    whole = label.panoptic_label
    label.panoptic_label = whole[:half] + bytes([whole[half] ^ 255]) + whole[half + 1 :]


def _field(name: str, value: Any) -> Callable[[Any], None]:
    return lambda label: setattr(label, name, value)


@pytest.mark.parametrize(
    ("damage", "reason"),
    [
        (_cut, "bytes), expected PNG"),
        (_flipped, "bytes), expected PNG"),
        (_field("panoptic_label", b"no picture"), "not a readable image (10 bytes), expected PNG"),
        (_field("panoptic_label", grey(np.uint8)), "expected a grey image of 16 bits, got uint8 of shape (240, 320)"),
        (
            _field("panoptic_label", grey(np.uint16, (300, 240))),
            "us: expected 320x240 pixels, as its table says, got 300x240",
        ),
        (_field("panoptic_label_divisor", 0), "panoptic_label_divisor: expected 1 to 65535, got 0"),
        (_field("panoptic_label_divisor", 1 << 30), "panoptic_label_divisor: expected 1 to 65535, got 1073741824"),
        (lambda label: label.ClearField("panoptic_label_divisor"), "expected 1 to 65535, got 0"),
    ],
)
def test_a_damaged_label_is_told_and_its_picture_kept(
    tmp_path: Path, damage: Callable[[Any], None], reason: str
) -> None:
    class Damaged(Records):
        def segmentation(self, camera: int, seconds: float) -> Any:
            label = super().segmentation(camera, seconds)
            if camera == 1:
                damage(label)
            return label

    Damaged().write(tmp_path / "src", 1)
    result = CliRunner().invoke(app, ["waymo", str(tmp_path / "src"), str(tmp_path / "out")])
    assert result.exit_code == 0, result.exception
    assert "FRONT pixel classes: missing in 1 of 1 key frames" in result.stderr
    (line,) = (line for line in result.stderr.splitlines() if reason in line)
    assert ".tfrecord: panoptic label of FRONT at 1553629304061000 us: " in line
    assert "1 key frames, 3 images" in result.stderr
    assert "2 images with pixel classes" in result.stderr
    assert set(views_of(Dataset(tmp_path / "out"), 0)) == {"CAM_SIDE_LEFT", "CAM_SIDE_RIGHT"}


@pytest.fixture
def components(sources: Path, tmp_path: Path) -> Path:
    """The file of labels in a copy of version 2."""
    shutil.copytree(sources / "v2", tmp_path / "v2")
    return tmp_path / "v2/training/camera_segmentation" / f"{NAME}.parquet"


def set_column(path: Path, name: str, values: list[Any]) -> None:
    table = pq.read_table(path)
    place = table.column_names.index(name)
    pq.write_table(table.set_column(place, name, pa.array(values, table.schema.field(name).type)), path)


def test_rows_of_version_2_without_a_label_or_divisor(components: Path, tmp_path: Path) -> None:
    png = panoptic_png(1, 0.0)
    set_column(components, LABEL, [png, None, png, png])  # a row without a label is a picture without one
    set_column(components, f"{LABEL}_divisor", [None, None, DIVISOR, 0])
    summary = convert(tmp_path / "v2", tmp_path / "out")
    assert (summary.pixel_classes, summary.images, summary.missing) == (1, 9, {"FRONT pixel classes": 2})
    assert "panoptic_label_divisor: expected 1 to 65535, got 0" in summary.damaged[0]


def test_version_2_without_the_component_has_a_note(components: Path, tmp_path: Path) -> None:
    components.unlink()
    summary = convert(tmp_path / "v2", tmp_path / "out")
    assert "no camera_segmentation: no pixel classes" in summary.notes
    assert (summary.pixel_classes, summary.missing) == (0, {})
    assert not (tmp_path / "out/views").exists()
    assert contents_of(Dataset(tmp_path / "out")).pixel_classes == 0


@pytest.mark.parametrize("lost", [LABEL, f"{LABEL}_divisor", "key.camera_name", "everything"])
def test_a_damaged_component_is_one_clear_line(components: Path, tmp_path: Path, lost: str) -> None:
    if lost == "everything":
        components.write_bytes(components.read_bytes()[:300])
    else:
        pq.write_table(pq.read_table(components).drop_columns(lost), components)
    with pytest.raises(DataError) as caught:
        convert(tmp_path / "v2", tmp_path / "out")
    assert str(components) in str(caught.value)
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "out").exists()
