from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from appocc.errors import DataError, ShapeError
from appocc.nuscenes.view_targets import ViewTargets, load_view_targets, save_view_targets


def test_saved_targets_load_unchanged(tmp_path: Path) -> None:
    random = np.random.default_rng(0)
    views = {
        name: ViewTargets(random.random((4, 6)).astype(dtype), random.integers(0, 9, (4, 6)).astype(np.uint8))
        for name, dtype in (("CAM_FRONT", np.float16), ("CAM_BACK", np.float32))
    }
    save_view_targets(tmp_path / "one.npz", views)
    again = load_view_targets(tmp_path / "one.npz")
    assert list(again) == list(views)
    for name, view in views.items():
        assert again[name].depth_m.dtype == view.depth_m.dtype
        assert (again[name].depth_m == view.depth_m).all()
        assert (again[name].kind == view.kind).all()
    first = (tmp_path / "one.npz").read_bytes()
    save_view_targets(tmp_path / "one.npz", views)
    assert (tmp_path / "one.npz").read_bytes() == first


def test_bad_files_and_shapes_are_refused(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="cannot be read"):
        load_view_targets(tmp_path / "none.npz")
    (tmp_path / "bad.npz").write_bytes(b"no zip")
    with pytest.raises(DataError, match="damaged depth and classes"):
        load_view_targets(tmp_path / "bad.npz")
    with pytest.raises(ShapeError, match="kind"):
        ViewTargets(np.zeros((2, 2), np.float16), np.zeros((2, 3), np.uint8))


def test_targets_copy_their_arrays() -> None:
    depth, kind = np.ones((2, 3), np.float16), np.ones((2, 3), np.uint8)
    targets = ViewTargets(depth, kind)
    depth[:], kind[:] = 5, 5
    assert (targets.depth_m == 1).all()
    assert (targets.kind == 1).all()
    assert not targets.depth_m.flags.writeable
    assert not targets.kind.flags.writeable
