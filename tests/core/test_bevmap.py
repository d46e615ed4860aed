"""The currency between model, truth and applications: checked, stored, and read back."""

from __future__ import annotations

import contextlib
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from appocc.bevmap import BEVMap, bev_path, load_map, map_sources
from appocc.errors import DataError, ShapeError
from appocc.grid import BEVGrid

GRID = BEVGrid(0, 2, -1, 1, 0.5)  # (4, 4) cells


def bev(**changes: Any) -> BEVMap:
    random = np.random.default_rng(3)
    fields: dict[str, Any] = {
        "grid": GRID,
        "occupancy": random.integers(0, 2, (3, 4, 4)).astype(np.float32),
        "occupancy_valid": random.random((3, 4, 4)) > 0.3,
        "appearance": random.integers(0, 256, (3, 4, 4)).astype(np.uint8),
        "appearance_valid": random.random((4, 4)) > 0.3,
        "meta": {"road": "mask", "token": "t"},
    }
    return BEVMap(**{**fields, **changes})


def assert_same(a: BEVMap, b: BEVMap, tolerance: float = 0.0) -> None:
    np.testing.assert_allclose(a.occupancy, b.occupancy, atol=tolerance)
    for name in ("occupancy_valid", "appearance", "appearance_valid"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
    assert (a.grid, dict(a.meta)) == (b.grid, dict(b.meta))


def test_a_truth_is_stored_as_bytes_and_comes_back_exactly(tmp_path: Path) -> None:
    bev().save(tmp_path / "a" / "t.npz")
    assert_same(BEVMap.load(tmp_path / "a" / "t.npz"), bev())
    with np.load(tmp_path / "a" / "t.npz") as data:
        assert {name: data[name].dtype.name for name in data.files if name != "meta"} == {
            "occupancy": "uint8",
            "occupancy_valid": "bool",
            "appearance": "uint8",
            "appearance_valid": "bool",
            "grid": "float64",
        }


@given(st.floats(0, 1, width=32))
def test_probabilities_come_back_to_a_thousandth(tmp_path_factory: pytest.TempPathFactory, p: float) -> None:
    path = tmp_path_factory.mktemp("bev") / "t.npz"
    predicted = bev(occupancy=np.full((3, 4, 4), p, np.float32))
    predicted.save(path)
    assert_same(BEVMap.load(path), predicted, tolerance=5e-4)


def test_the_same_map_gives_the_same_bytes(tmp_path: Path) -> None:
    for name, meta in (("a.npz", {"x": 1, "y": 2}), ("b.npz", {"y": 2, "x": 1})):
        bev(meta=meta).save(tmp_path / name)
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()


def test_a_map_of_another_tool_may_lack_meta(tmp_path: Path) -> None:
    bev().save(tmp_path / "a.npz")
    with np.load(tmp_path / "a.npz") as data:
        np.savez(tmp_path / "b.npz", **{name: data[name] for name in data.files if name != "meta"})
    assert BEVMap.load(tmp_path / "b.npz").meta == {}


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"occupancy": np.zeros((3, 4, 5), np.float32)}, r"occupancy: expected shape \(3, 4, 4\), got \(3, 4, 5\)"),
        ({"occupancy": np.zeros((3, 4, 4))}, "occupancy: expected float32, got float64"),
        ({"occupancy": np.full((3, 4, 4), 1.5, np.float32)}, r"expected values in \[0, 1\], got 1.5..1.5"),
        ({"occupancy": np.full((3, 4, 4), np.nan, np.float32)}, r"expected values in \[0, 1\], got nan"),
        ({"occupancy_valid": np.zeros((4, 4), np.bool_)}, "occupancy_valid: expected shape"),
        ({"appearance": np.zeros((4, 4, 3), np.uint8)}, "appearance: expected shape"),
        ({"appearance": np.zeros((3, 4, 4), np.float32)}, "appearance: expected uint8, got float32"),
        ({"appearance_valid": np.zeros((4, 4), np.uint8)}, "appearance_valid: expected bool, got uint8"),
        ({"meta": None}, "meta: expected values by name, got None"),
    ],
)
def test_what_is_no_map(changes: dict[str, Any], reason: str) -> None:
    with pytest.raises(ShapeError, match=reason):
        bev(**changes)


def test_a_map_is_frozen_through_and_through() -> None:
    with pytest.raises(ValueError, match="read-only"):
        bev().appearance[0, 0, 0] = 1


def test_files_that_are_no_map(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"none\.npz: cannot be read \(No such file"):
        BEVMap.load(tmp_path / "none.npz")
    np.savez(tmp_path / "part.npz", grid=GRID.as_array())
    with pytest.raises(DataError, match=r"part\.npz: no BEV map, .*occupancy"):
        BEVMap.load(tmp_path / "part.npz")
    np.save(tmp_path / "array.npy", np.zeros(3))
    with pytest.raises(DataError, match=r"array\.npy: damaged BEV map"):
        BEVMap.load(tmp_path / "array.npy")
    (tmp_path / "text.npz").write_text("hello")
    with pytest.raises(DataError, match=r"text\.npz: damaged BEV map"):
        BEVMap.load(tmp_path / "text.npz")


def test_a_map_that_contradicts_its_grid(tmp_path: Path) -> None:
    bev().save(tmp_path / "a.npz")
    with np.load(tmp_path / "a.npz") as data:
        np.savez(tmp_path / "b.npz", **{**{n: data[n] for n in data.files}, "grid": [0, 4, -1, 1, 0.5]})
    with pytest.raises(DataError, match=r"b\.npz: damaged BEV map \(occupancy: expected shape \(3, 8, 4\)"):
        BEVMap.load(tmp_path / "b.npz")


@pytest.mark.parametrize("meta", [[1], None, "x", {"thresholds": [0.5]}, {"thresholds": {"road": float("nan")}}])
def test_a_file_whose_meta_cannot_be_true_is_named(tmp_path: Path, meta: object) -> None:
    bev().save(tmp_path / "a.npz")
    with np.load(tmp_path / "a.npz") as data:
        arrays = {name: data[name] for name in data.files} | {"meta": np.array(json.dumps(meta))}
        np.savez(tmp_path / "b.npz", **arrays)
    with pytest.raises(DataError, match=r"b\.npz: damaged BEV map \((meta|thresholds of a map): expected"):
        BEVMap.load(tmp_path / "b.npz")


@given(st.integers(0, 10_000), st.integers(1, 255))
def test_any_damage_is_an_error_of_ours_or_does_no_harm(
    tmp_path_factory: pytest.TempPathFactory, at: int, change: int
) -> None:
    path = tmp_path_factory.mktemp("bev") / "t.npz"
    bev().save(path)
    data = bytearray(path.read_bytes())
    data[at % len(data)] ^= change
    path.write_bytes(data)
    with contextlib.suppress(DataError):
        assert BEVMap.load(path).grid.shape


def test_meta_is_json(tmp_path: Path) -> None:
    bev().save(tmp_path / "a.npz")
    with np.load(tmp_path / "a.npz") as data:
        assert json.loads(str(data["meta"])) == {"road": "mask", "token": "t"}


def test_where_maps_lie() -> None:
    assert bev_path(Path("/r"), "exact", "t") == Path("/r/bev/exact/t.npz")
    assert bev_path(Path("/r"), "/elsewhere/x", "t") == Path("/elsewhere/x/t.npz")
    assert bev_path(Path("/r"), "out/bev", "t") == Path("out/bev/t.npz")


@pytest.mark.parametrize(
    ("meta", "truth"),
    [
        ({"source": "simulated"}, True),
        ({"sources": {"road": "map"}}, True),
        ({"source": "predicted", "thresholds": {"road": 0.5, "vehicle": 0.5, "lane": 0.5}}, False),
        ({}, False),
    ],
)
def test_the_meta_says_whether_a_map_is_true(meta: dict[str, Any], truth: bool) -> None:
    assert bev(meta=meta).is_truth == truth


def test_a_missing_map_names_the_sources_that_there_are(tmp_path: Path) -> None:
    for source in ("exact", "mine"):
        bev().save(bev_path(tmp_path, source, "t"))
    with pytest.raises(DataError, match=r"there are maps of source exact and mine; make it with: appocc groundtruth"):
        load_map(tmp_path, "groundtruth", "t")
    with pytest.raises(DataError, match=r"exact maps come with simulated drives only"):
        load_map(tmp_path, "exact", "other")
    assert map_sources(tmp_path) == ["exact", "mine"]
