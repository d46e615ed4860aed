"""The written files follow the rules of panopticapi (evaluation.py): every id of a PNG has one segment, and back."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_pack_source import GRID, INSTANCES, contents, made_map, made_source
from tiny_dataset import TinyDataset

from appocc.errors import DataError
from appocc.files import read_image
from appocc.packing.coco_panoptic import pack_panoptic, panoptic_ids
from appocc.packing.frames import PackSource


def pack(source: PackSource, out: Path) -> dict[str, Any]:
    path = pack_panoptic(source, source.key_frames(), out, None, lambda count: None)
    value: dict[str, Any] = json.loads(path.read_text())
    return value


def pixel_ids(path: Path) -> np.ndarray:
    """Ids of the pixels, as panopticapi's rgb2id."""
    rgb = read_image(path).astype(np.int64)
    return np.asarray(rgb[..., 0] + 256 * rgb[..., 1] + 256 * 256 * rgb[..., 2])


def check_by_panopticapi(folder: Path, value: dict[str, Any]) -> None:
    categories = {each["id"]: each for each in value["categories"]}
    assert all({"id", "name", "isthing", "color", "supercategory"} <= each.keys() for each in value["categories"])
    images = {each["id"]: each for each in value["images"]}
    assert len(images) == len(value["images"]) == len(value["annotations"])
    for annotation in value["annotations"]:
        image = images[annotation["image_id"]]
        pixels = pixel_ids(folder / "panoptic" / annotation["file_name"])
        assert pixels.shape == (image["height"], image["width"])
        assert read_image(folder / "images" / image["file_name"]).shape[:2] == pixels.shape
        segments = {each["id"]: each for each in annotation["segments_info"]}
        assert len(segments) == len(annotation["segments_info"])
        present, areas = np.unique(pixels[pixels != 0], return_counts=True)
        assert set(present.tolist()) == set(segments)
        for number, area in zip(present.tolist(), areas.tolist(), strict=True):
            segment = segments[number]
            rows, columns = np.nonzero(pixels == number)
            x, y, width, height = segment["bbox"]
            assert (segment["area"], segment["iscrowd"]) == (area, 0)
            assert (x, y) == (columns.min(), rows.min())
            assert (x + width - 1, y + height - 1) == (columns.max(), rows.max())
            assert segment["category_id"] in categories
        stuff = [each["category_id"] for each in segments.values() if not categories[each["category_id"]]["isthing"]]
        assert len(set(stuff)) == len(stuff)  # stuff is one segment a picture


def test_files_follow_the_rules_of_panopticapi(tiny: TinyDataset, tmp_path: Path) -> None:
    value = pack(made_source(tiny), tmp_path / "out")
    check_by_panopticapi(tmp_path / "out", value)
    assert [each["file_name"] for each in value["images"]] == [f"scene-tiny-000{i}.png" for i in range(3)]
    vehicles = [each for each in value["annotations"][0]["segments_info"] if each["category_id"] == 2]
    assert [(each["area"], each.get("instance_token")) for each in vehicles] == [
        (4, INSTANCES[0]),
        (4, INSTANCES[1]),
        (2, None),
    ]


def test_pictures_have_forward_up_and_left_at_the_left(tiny: TinyDataset, tmp_path: Path) -> None:
    value = pack(made_source(tiny), tmp_path / "out")
    assert read_image(tmp_path / "out/images/scene-tiny-0000.png")[0, 0, 0] == 200
    first = value["annotations"][0]["segments_info"]
    boxes = {each.get("instance_token"): each["bbox"] for each in first}
    assert boxes["first"] == [12, 13, 2, 2]  # x cells 1..2 of 16 are near the bottom, y cells 2..3 at the right


def test_a_vehicle_hides_the_lane_and_that_the_road_and_unknown_cells_are_void() -> None:
    bev, instance = made_map()
    ids, names = panoptic_ids(bev, instance.astype(np.int64), INSTANCES)
    assert ids.shape == GRID.shape
    assert (ids[0, 0], ids[0, 6], ids[0, 9], ids[0, 13], ids[0, 14]) == (1, 3, 4, 0, 0)
    assert {names[each] for each in np.unique(ids[1:3, 2:4]).tolist()} == {"first"}
    assert {names[each] for each in np.unique(ids[3:5, 2:4]).tolist()} == {"second"}
    assert ids[10, 10] == ids[11, 10] not in names


def test_without_an_owner_a_connected_region_is_a_vehicle(tiny: TinyDataset, tmp_path: Path) -> None:
    value = pack(made_source(tiny, with_instance=False), tmp_path / "out")
    check_by_panopticapi(tmp_path / "out", value)
    areas = [each["area"] for each in value["annotations"][0]["segments_info"] if each["category_id"] == 2]
    assert areas == [8, 2]


def test_an_interrupted_pack_resumes_with_the_same_bytes(tiny: TinyDataset, tmp_path: Path) -> None:
    def interrupt(count: float) -> None:
        if count:
            raise KeyboardInterrupt

    source = made_source(tiny)
    with pytest.raises(KeyboardInterrupt):
        pack_panoptic(source, source.key_frames(), tmp_path / "out", None, interrupt)
    assert not (tmp_path / "out").exists()
    pack(source, tmp_path / "out")
    pack(source, tmp_path / "at-once")
    assert contents(tmp_path / "out") == contents(tmp_path / "at-once")
    assert not list(tmp_path.glob(".out*"))


def test_vehicles_of_another_grid_are_refused(tiny: TinyDataset, tmp_path: Path) -> None:
    source = made_source(tiny)
    sample = source.dataset.samples(source.dataset.scenes[0])[0]
    made_map()[0].save(source.map_path(sample), {"instance": np.zeros((3, 3), np.int16)})
    with pytest.raises(DataError, match=r"instance: expected shape \(16, 16\), got \(3, 3\)"):
        pack(source, tmp_path / "out")
    assert not (tmp_path / "out").exists()
