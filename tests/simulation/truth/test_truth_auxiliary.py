from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from appocc.errors import DataError, ShapeError
from appocc.simulation.truth.auxiliary import ViewTargets, load_views, reduce_view, save_views


def test_a_block_takes_its_commonest_class_and_that_class_s_median_depth() -> None:
    depth, kind = np.full((16, 24), 40.0, np.float32), np.ones((16, 24), np.uint8)
    depth[:8, :5], kind[:8, :5] = 10, 3  # 5 of 8 columns of the first block
    depth[:8, 8:11], kind[:8, 8:11] = 10, 3  # 3 of 8 of the second
    depth[8:, 16:], kind[8:, 16:] = np.inf, 0
    view = reduce_view(depth, kind)
    assert view.kind.tolist() == [[3, 1, 1], [1, 1, 0]]
    assert view.depth_m.tolist() == [[10, 40, 40], [40, 40, np.inf]]
    assert view.depth_m.dtype == np.float16


def test_of_equal_classes_the_nearer_wins() -> None:
    depth, kind = np.full((8, 8), 30.0, np.float32), np.full((8, 8), 2, np.uint8)
    depth[4:], kind[4:] = 9, 7
    assert (reduce_view(depth, kind).kind[0, 0], reduce_view(depth, kind).depth_m[0, 0]) == (7, 9)
    assert (reduce_view(depth[::-1].copy(), kind[::-1].copy()).depth_m[0, 0]) == 9


def test_blocks_at_the_edge_are_cut() -> None:
    depth = np.arange(10 * 9, dtype=np.float32).reshape(10, 9)
    view = reduce_view(depth, np.zeros((10, 9), np.uint8))
    assert view.depth_m.shape == (2, 2)
    assert view.depth_m[1, 1] in depth[8:, 8:]
    assert view.depth_m[0, 0] == np.sort(depth[:8, :8].ravel())[31]


def test_what_is_saved_is_loaded(tmp_path: Path) -> None:
    random = np.random.default_rng(0)
    views = {
        name: ViewTargets(random.random((4, 6)).astype(dtype), random.integers(0, 9, (4, 6)).astype(np.uint8))
        for name, dtype in (("CAM_FRONT", np.float16), ("CAM_BACK", np.float32))
    }
    save_views(tmp_path / "one.npz", views)
    again = load_views(tmp_path / "one.npz")
    assert list(again) == list(views)
    for name, view in views.items():
        assert again[name].depth_m.dtype == view.depth_m.dtype
        assert (again[name].depth_m == view.depth_m).all()
        assert (again[name].kind == view.kind).all()
    first = (tmp_path / "one.npz").read_bytes()
    save_views(tmp_path / "one.npz", views)
    assert (tmp_path / "one.npz").read_bytes() == first


def test_bad_files_and_shapes_are_told(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="cannot be read"):
        load_views(tmp_path / "none.npz")
    (tmp_path / "bad.npz").write_bytes(b"no zip")
    with pytest.raises(DataError, match="damaged depth file"):
        load_views(tmp_path / "bad.npz")
    with pytest.raises(ShapeError, match="kind"):
        ViewTargets(np.zeros((2, 2), np.float16), np.zeros((2, 3), np.uint8))
