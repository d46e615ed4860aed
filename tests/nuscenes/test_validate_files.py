"""Every way in which the files of a dataset can be broken is named with its table, its token and the reason."""

from __future__ import annotations

import shutil
from collections.abc import Callable

import cv2
import numpy as np
import pytest
from findings import FRONT, LIDAR, assert_only, found
from tiny_dataset import TinyDataset, token


def test_names_that_lead_out_of_the_root(tiny: TinyDataset) -> None:
    tiny.tables["sample_data"][0]["filename"] = "../../etc/passwd"
    tiny.tables["map"][0]["filename"] = "/etc/passwd"
    tiny.tables["lidarseg"] = [{"token": "l", "sample_data_token": LIDAR, "filename": ""}]
    assert_only(
        found(tiny),
        ("sample_data", FRONT, "name leads out", "'../../etc/passwd' leads out of the root"),
        ("map", token("map"), "name leads out", "'/etc/passwd'"),
        ("lidarseg", "l", "name leads out", "''"),
    )


def test_files_that_are_missing(tiny: TinyDataset) -> None:
    names = [tiny.row("sample_data", t)["filename"] for t in (FRONT, token("LIDAR_TOP", 500_000))]
    for name in (*names, "maps/drivable.png"):
        (tiny.root / name).unlink()
    assert_only(
        found(tiny),
        ("sample_data", FRONT, "missing file", f"no file {names[0]}"),
        ("sample_data", token("LIDAR_TOP", 500_000), "missing file", f"no file {names[1]}"),
        ("map", token("map"), "missing file", "no file maps/drivable.png"),
    )


def test_sweeps_that_were_not_downloaded_are_a_note_a_folder(tiny: TinyDataset) -> None:
    shutil.rmtree(tiny.root / "sweeps")
    problems = found(tiny)
    assert {(p.kind, p.severity) for p in problems} == {("missing sweeps", "note")}
    assert problems[0].reason == "none of the 1 sweeps in sweeps/CAM_FRONT is there"
    assert len(problems) == 3


def test_key_frames_that_were_not_downloaded_are_errors(tiny: TinyDataset) -> None:
    for path in (tiny.root / "samples" / "CAM_BACK").iterdir():
        path.unlink()
    assert [(p.kind, p.severity) for p in found(tiny)] == [("missing file", "error")] * 3


@pytest.mark.parametrize("images", [True, False])
@pytest.mark.parametrize("damage", [lambda d: d[:-30], lambda d: d[:20], lambda d: b"", lambda d: b"hello"])
def test_images_that_cannot_be_read(tiny: TinyDataset, images: bool, damage: Callable[[bytes], bytes]) -> None:
    path = tiny.root / tiny.tables["sample_data"][0]["filename"]
    path.write_bytes(damage(path.read_bytes()))
    assert_only(found(tiny, images), ("sample_data", FRONT, "unreadable camera file", str(path)))


@pytest.mark.parametrize("images", [True, False])
def test_png_images_that_are_cut_off(tiny: TinyDataset, images: bool) -> None:
    row = tiny.tables["sample_data"][0]
    row["filename"] = "samples/CAM_FRONT/a.png"
    data = cv2.imencode(".png", np.zeros((20, 32, 3), np.uint8))[1].tobytes()
    (tiny.root / row["filename"]).write_bytes(data)
    assert found(tiny, images) == []
    (tiny.root / row["filename"]).write_bytes(data[:-6])
    assert [p.kind for p in found(tiny, images)] == ["unreadable camera file"]


@pytest.mark.parametrize("images", [True, False])
def test_images_of_another_size(tiny: TinyDataset, images: bool) -> None:
    tiny.tables["sample_data"][0].update(width=1600, height=900)
    tiny.tables["sample_data"][1].update(width=0, height=0)
    assert_only(found(tiny, images), ("sample_data", FRONT, "wrong image size", "is 32x20, the table says 1600x900"))


@pytest.mark.parametrize("images", [True, False])
@pytest.mark.parametrize("size", [0, 19, 30])
def test_lidar_files_of_wrong_length(tiny: TinyDataset, images: bool, size: int) -> None:
    path = tiny.root / tiny.row("sample_data", LIDAR)["filename"]
    path.write_bytes(bytes(size))
    reason = f"expected rows of 5 float32 (20 bytes), got {size} bytes"
    assert_only(found(tiny, images), ("sample_data", LIDAR, "unreadable lidar file", reason))


def test_lidar_points_that_are_not_finite(tiny: TinyDataset) -> None:
    path = tiny.root / tiny.row("sample_data", LIDAR)["filename"]
    path.write_bytes(np.array([[0, 0, np.nan, 0, 0], [np.inf, 0, 0, 0, 0], [0] * 5], np.float32).tobytes())
    assert found(tiny, images=False) == []
    assert_only(found(tiny), ("sample_data", LIDAR, "bad LiDAR points", "2 points of"))


def test_files_of_other_sensors_only_have_to_be_there(tiny: TinyDataset) -> None:
    tiny.tables["sensor"][2]["modality"] = "radar"
    for path in tiny.root.glob("s*/LIDAR_TOP/*"):
        path.write_bytes(b"anything")
    assert found(tiny) == []


def test_masks_that_are_cut_off(tiny: TinyDataset) -> None:
    path = tiny.root / "maps/drivable.png"
    path.write_bytes(path.read_bytes()[:-10])
    assert_only(found(tiny), ("map", token("map"), "unreadable mask", "no PNG image, or truncated"))


def test_point_labels(tiny: TinyDataset) -> None:
    tiny.tables["lidarseg"] = [
        {"token": "a", "sample_data_token": LIDAR, "filename": "lidarseg/a.bin"},
        {"token": "b", "sample_data_token": token("LIDAR_TOP", 500_000), "filename": "lidarseg/b.bin"},
        {"token": "c", "sample_data_token": token("LIDAR_TOP", 1_000_000), "filename": "lidarseg/c.bin"},
        {"token": "d", "sample_data_token": "gone", "filename": "lidarseg/a.bin"},
    ]
    (tiny.root / "lidarseg").mkdir()
    (tiny.root / "lidarseg/a.bin").write_bytes(bytes(3))
    (tiny.root / "lidarseg/b.bin").write_bytes(bytes(2))
    assert_only(
        found(tiny),
        ("lidarseg", "d", "broken reference", "sample_data_token 'gone' is not in the table sample_data"),
        ("lidarseg", "b", "wrong number of labels", "lidarseg/b.bin has 2 labels, samples/LIDAR_TOP"),
        ("lidarseg", "c", "missing file", "no file lidarseg/c.bin"),
    )


def test_labels_of_a_missing_lidar_file_are_not_checked(tiny: TinyDataset) -> None:
    tiny.tables["lidarseg"] = [{"token": "a", "sample_data_token": LIDAR, "filename": "lidarseg/a.bin"}]
    (tiny.root / "lidarseg").mkdir()
    (tiny.root / "lidarseg/a.bin").write_bytes(bytes(9))
    (tiny.root / tiny.row("sample_data", LIDAR)["filename"]).unlink()
    assert [p.kind for p in found(tiny)] == ["missing file"]


def test_a_sweep_without_a_finite_point(tiny: TinyDataset) -> None:
    path = tiny.root / tiny.row("sample_data", LIDAR)["filename"]
    path.write_bytes(np.full((300, 5), np.nan, np.float32).tobytes())
    for images in (True, False):
        assert_only(found(tiny, images), ("sample_data", LIDAR, "unreadable lidar file", "got 300 that are not"))


def test_a_sweep_that_only_begins_without_finite_points(tiny: TinyDataset) -> None:
    path = tiny.root / tiny.row("sample_data", LIDAR)["filename"]
    path.write_bytes(np.repeat([[np.nan], [1.0]], [300, 1], axis=0).repeat(5, axis=1).astype(np.float32).tobytes())
    assert found(tiny, images=False) == []
    assert [p.kind for p in found(tiny)] == ["bad LiDAR points"]


def test_images_with_trailing_padding_are_valid(tiny: TinyDataset) -> None:
    with (tiny.root / tiny.row("sample_data", FRONT)["filename"]).open("ab") as file:
        file.write(bytes(500))
    assert found(tiny, images=True) == found(tiny, images=False) == []


def test_a_truncated_image_with_an_end_marker(tiny: TinyDataset) -> None:
    path = tiny.root / tiny.row("sample_data", FRONT)["filename"]
    noise = np.random.default_rng(1).integers(0, 255, (20, 32, 3), np.uint8)
    data = cv2.imencode(".jpg", noise)[1].tobytes()
    path.write_bytes(data[: len(data) * 3 // 4] + b"\xff\xd9")
    assert_only(found(tiny), ("sample_data", FRONT, "unreadable camera file", "its end mark comes too early"))
