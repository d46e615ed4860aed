"""Masks and map expansions."""

from __future__ import annotations

import io
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from PIL import Image
from tiny_dataset import TinyDataset

from appocc.checks import ByteArray, FloatArray
from appocc.errors import DataError
from appocc.nuscenes import Dataset
from appocc.nuscenes.maps import VectorMap, mask_window, read_vector_map, vector_map


def with_mask(tiny: TinyDataset, grey: ByteArray, **fields: Any) -> Dataset:
    assert cv2.imwrite(str(tiny.root / "maps" / "drivable.png"), grey)
    tiny.tables["map"][0].update(fields)
    return Dataset(tiny.write())


def picture() -> ByteArray:
    """4 m x 3 m: drivable but for a strip along the lower edge (y < 0.5 m) and the right half of the rest."""
    grey = np.full((30, 40), 255, np.uint8)
    grey[25:] = 0
    grey[:25, 20:] = 0
    return grey


EVERYWHERE = np.array([-1000.0, -1000.0]), np.array([1000.0, 1000.0])
PLACES = np.array([[1.0, 1.0], [1.0, 0.45], [1.99, 2.99], [2.01, 2.0], [0.01, 0.51], [4.1, 1.0], [-0.1, 1], [1, 3.1]])
DRIVABLE = [True, False, True, False, True, False, False, False]
KNOWN = [True] * 5 + [False] * 3


def test_top_row_is_largest_y_and_ten_pixels_are_a_metre(tiny: TinyDataset) -> None:
    dataset = with_mask(tiny, picture())
    window = mask_window(dataset, dataset.scenes[0], *EVERYWHERE)
    assert window is not None
    drivable, known = window.sample(PLACES)
    assert drivable.tolist() == DRIVABLE
    assert known.tolist() == KNOWN
    assert (window.unknown_value, window.source) == (None, "")


def test_an_origin_moves_the_mask(tiny: TinyDataset) -> None:
    dataset = with_mask(tiny, picture(), origin_m=[-70.0, 30.5], unknown_value=127, source="made up")
    window = mask_window(dataset, dataset.scenes[0], *EVERYWHERE)
    assert window is not None
    drivable, known = window.sample(PLACES + np.array([-70.0, 30.5]))
    assert drivable.tolist() == DRIVABLE
    assert known.tolist() == KNOWN
    assert window.source == "made up"


def test_a_grey_value_may_mean_unknown(tiny: TinyDataset) -> None:
    grey = picture()
    grey[:10] = 127
    dataset = with_mask(tiny, grey, unknown_value=127)
    window = mask_window(dataset, dataset.scenes[0], *EVERYWHERE)
    assert window is not None
    drivable, known = window.sample(np.array([[1.0, 2.5], [1.0, 1.5]]))
    assert known.tolist() == [False, True]
    assert drivable.tolist() == [False, True]


def test_a_window_equals_the_whole_mask(tiny: TinyDataset) -> None:
    grey = np.random.default_rng(1).choice(np.array([0, 255], np.uint8), (300, 400))
    dataset = with_mask(tiny, grey, origin_m=[-10.0, 5.0])
    scene = dataset.scenes[0]
    whole = mask_window(dataset, scene, *EVERYWHERE)
    part = mask_window(dataset, scene, np.array([3.33, 12.34]), np.array([17.77, 20.2]))
    assert whole is not None
    assert part is not None
    assert part.grey.size < whole.grey.size / 5
    places = np.random.default_rng(2).uniform([3.33, 12.34], [17.77, 20.2], (500, 10, 2))
    for one, other in zip(whole.sample(places), part.sample(places), strict=True):
        assert one.shape == (500, 10)
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("low", [(50.0, 0.0), (0.0, 50.0), (-90.0, 0.0), (0.0, -90.0)])
def test_a_mask_that_does_not_reach_the_scene_is_none(tiny: TinyDataset, low: tuple[float, float]) -> None:
    dataset = with_mask(tiny, picture())
    assert mask_window(dataset, dataset.scenes[0], np.array(low), np.array(low) + 20.0) is None


def test_a_scene_without_a_mask(tiny: TinyDataset) -> None:
    tiny.tables["map"] = []
    dataset = Dataset(tiny.write())
    assert mask_window(dataset, dataset.scenes[0], *EVERYWHERE) is None


def _postscript() -> bytes:
    """A grey picture as EPS, which Pillow gives to Ghostscript."""
    stream = io.BytesIO()
    Image.new("L", (8, 8)).save(stream, "EPS")
    return stream.getvalue()


def test_masks_that_cannot_be_read(tiny: TinyDataset) -> None:
    path = tiny.root / "maps" / "drivable.png"
    whole = path.read_bytes()
    dataset = Dataset(tiny.root)
    for data in (b"no picture", whole[: len(whole) // 2], _postscript(), None):
        path.unlink() if data is None else path.write_bytes(data)
        reason = "cannot be read" if data is None else "not a readable map mask"
        with pytest.raises(DataError, match=rf"maps/drivable\.png: {reason}"):
            mask_window(dataset, dataset.scenes[0], *EVERYWHERE)


def test_a_mask_stays_below_the_root(tiny: TinyDataset) -> None:
    tiny.tables["map"][0]["filename"] = "../elsewhere.png"
    dataset = Dataset(tiny.write())
    with pytest.raises(DataError, match="leads out of this folder"):
        mask_window(dataset, dataset.scenes[0], *EVERYWHERE)


@pytest.mark.realdata
def test_a_published_mask(data_root: Path) -> None:
    dataset = Dataset(data_root / "nuscenes_real")
    for scene in dataset.scenes:
        (sample,) = dataset.samples(scene)
        ego = dataset.world_from_ego(sample)[:2, 3]
        window = mask_window(dataset, scene, ego - 60, ego + 60)
        assert window is not None
        assert window.grey.shape == pytest.approx((1201, 1201), abs=1)
        boxes = dataset.boxes_world(sample).vehicles()
        drivable, known = window.sample(np.vstack([ego, boxes.centre_m[:, :2]]))
        assert drivable[0]
        near = known[1:]
        assert drivable[1:][near].mean() > 0.85


# Map expansions -----------------------------------------------------------------------------------------------------

NODES = {
    "a": (0.0, 0.0),
    "b": (10.0, 0.0),
    "c": (10.0, 8.0),
    "d": (0.0, 8.0),
    "e": (2.0, 2.0),
    "f": (4.0, 2.0),
    "g": (4.0, 4.0),
    "h": (50.0, 50.0),
    "i": (60.0, 50.0),
    "j": (60.0, 60.0),
}


def expansion() -> dict[str, Any]:
    """A street with a hole, a car park far away, one divider of each kind, and a stop line."""
    return {
        "node": [{"token": name, "x": x, "y": y} for name, (x, y) in NODES.items()],
        "line": [
            {"token": "l1", "node_tokens": ["a", "b", "c"]},
            {"token": "l2", "node_tokens": ["h", "i"]},
            {"token": "l3", "node_tokens": []},
        ],
        "polygon": [
            {"token": "p1", "exterior_node_tokens": list("abcd"), "holes": [{"node_tokens": list("efg")}]},
            {"token": "p2", "exterior_node_tokens": list("hij"), "holes": []},
            {"token": "p3", "exterior_node_tokens": list("efg"), "holes": [{"node_tokens": ["a", "b"]}]},
            {"token": "p4", "exterior_node_tokens": ["a", "b"], "holes": []},
        ],
        "drivable_area": [{"token": "x", "polygon_tokens": ["p1", "p4"]}],
        "carpark_area": [{"token": "y", "polygon_token": "p2"}],
        "lane_divider": [{"token": "z", "line_token": "l1"}, {"token": "v", "line_token": "l3"}],
        "road_divider": [{"token": "w", "line_token": "l2"}],
        "stop_line": [{"token": "u", "polygon_token": "p3"}],
        "ped_crossing": [{"token": "t", "polygon_token": "p2"}],
    }


def read(folder: Path, data: Any) -> VectorMap:
    path = folder / "made-town.json"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(data))
    return read_vector_map(path)


def at(names: str) -> FloatArray:
    return np.array([NODES[name] for name in names])


def test_a_map_expansion(tmp_path: Path) -> None:
    found = read(tmp_path, expansion())
    assert found.drivable is not None
    assert found.markings is not None
    (street, (hole,)), (park, none) = found.drivable  # what has two corners is no area
    for got, expected in ((street, "abcd"), (hole, "efg"), (park, "hij")):
        np.testing.assert_array_equal(got, at(expected))
    assert none == ()
    assert len(found.markings) == 3  # zebra crossings are none; a stop line is drawn around
    for got, expected in zip(found.markings, ("abc", "hi", "efge"), strict=True):
        np.testing.assert_array_equal(got, at(expected))


def test_landmarks_of_a_map_expansion(tmp_path: Path) -> None:
    data = expansion()
    found = read(tmp_path, data).landmarks
    assert {kind: len(outlines) for kind, outlines in found.items()} == {"crossing": 1, "stop line": 1, "car park": 1}
    data["stop_line"].append({"token": "s", "polygon_token": "p1", "stop_line_type": "TRAFFIC_LIGHT"})
    data["road_segment"] = [
        {"token": str(number), "polygon_token": "p1", "is_intersection": bool(number)} for number in (0, 1)
    ]
    found = read(tmp_path, data).landmarks
    assert [len(found[kind]) for kind in ("stop line", "traffic light", "stop sign", "junction")] == [2, 1, 0, 1]
    np.testing.assert_array_equal(found["junction"][0], at("abcd"))
    far = read(tmp_path, data).near(np.array([5000.0, 5000.0]), np.array([5001.0, 5001.0])).landmarks
    assert far["junction"] == ()  # the layer is known, with nothing here


def test_only_what_is_near(tmp_path: Path) -> None:
    near = read(tmp_path, expansion()).near(np.array([-5.0, -5.0]), np.array([20.0, 20.0]))
    assert near.drivable is not None
    assert near.markings is not None
    assert [len(area[0]) for area in near.drivable] == [4]
    assert [len(line) for line in near.markings] == [3, 4]
    inside = read(tmp_path, expansion()).near(np.array([4.5, 4.5]), np.array([5.0, 5.0]))
    assert inside.drivable is not None
    assert len(inside.drivable) == 1  # around the place that is asked for


def test_layers_that_a_map_does_not_have_are_no_source(tmp_path: Path) -> None:
    data = expansion()
    for name in ("lane_divider", "road_divider", "stop_line"):
        del data[name]
    roads = read(tmp_path, data)
    assert roads.markings is None
    assert roads.near(*EVERYWHERE).markings is None
    assert roads.near(*EVERYWHERE).drivable is not None
    data["stop_line"] = []
    assert read(tmp_path, data).markings == ()  # it has the layer, with nothing in it
    del data["drivable_area"]
    lines = read(tmp_path, data)
    assert lines.drivable is None
    assert lines.near(*EVERYWHERE).drivable is None
    del data["stop_line"]
    with pytest.raises(DataError, match=r"made-town\.json: no map expansion \(it has neither drivable_area"):
        read(tmp_path, data)


BAD: dict[str, Callable[[dict[str, Any]], object]] = {
    "no nodes": lambda d: d.pop("node"),
    "no lines": lambda d: d.pop("line"),
    "no polygons": lambda d: d.pop("polygon"),
    "a node that is not there": lambda d: d["line"][0].update(node_tokens=["a", "q"]),
    "a polygon that is not there": lambda d: d["drivable_area"][0].update(polygon_tokens=["q"]),
    "a line that is not there": lambda d: d["lane_divider"][0].update(line_token="q"),
    "a node without a place": lambda d: d["node"][0].pop("x"),
    "a node that is nowhere": lambda d: d["node"][0].update(x=float("nan")),
    "a place in words": lambda d: d["node"][0].update(x="here"),
    "rows that are none": lambda d: d.update(polygon=["p1"]),
    "tables that are none": lambda d: d.update(node=7),
    "dividers that are none": lambda d: d.update(lane_divider=["l1"]),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_map_expansions(tmp_path: Path, name: str) -> None:
    data = expansion()
    BAD[name](data)
    with pytest.raises(DataError, match=r"made-town\.json: no map expansion") as caught:
        read(tmp_path, data)
    assert "\n" not in str(caught.value)


def test_a_map_expansion_that_is_no_map(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="no map expansion"):
        read(tmp_path, [1, 2])
    (tmp_path / "half.json").write_text('{"node": [')
    with pytest.raises(DataError, match=r"half\.json: no valid JSON"):
        read_vector_map(tmp_path / "half.json")


def test_the_map_of_a_scene_s_town(tiny: TinyDataset) -> None:
    dataset = Dataset(tiny.root)
    assert vector_map(dataset, dataset.scenes[0]) is None
    read(tiny.root / "maps" / "expansion", expansion())
    assert vector_map(dataset, dataset.scenes[0]) is None  # another town
    (tiny.root / "maps" / "expansion" / "made-town.json").rename(tiny.root / "maps" / "expansion" / "nowhere.json")
    found = vector_map(dataset, dataset.scenes[0])
    assert found is not None
    assert found.markings is not None
    (tiny.root / "maps" / "expansion" / "nowhere.json").rename(tiny.root / "maps" / "nowhere.json")
    assert vector_map(dataset, dataset.scenes[0]) is not None  # where older copies of the maps have it


@pytest.mark.parametrize("location", ["", None, "../secret"])
def test_towns_without_a_name_or_with_a_wrong_one(tiny: TinyDataset, location: str | None) -> None:
    tiny.tables["log"][0]["location"] = location
    dataset = Dataset(tiny.write())
    if location:
        with pytest.raises(DataError, match="leads out of this folder"):
            vector_map(dataset, dataset.scenes[0])
    else:
        assert vector_map(dataset, dataset.scenes[0]) is None


def test_a_colour_map_image_is_not_a_mask(tiny: TinyDataset) -> None:
    dataset = with_mask(tiny, np.full((50, 50, 3), 255, np.uint8))
    assert mask_window(dataset, dataset.scenes[0], *EVERYWHERE) is None
