from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
import pytest

from appocc.errors import DataError, ShapeError
from appocc.nuscenes.view_targets import (
    UNKNOWN_KIND,
    ViewTargets,
    count_labelled_images,
    load_view_targets,
    save_view_targets,
)


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
        read = again[name].arrays()
        for part, array in view.arrays().items():
            assert read[part].dtype == array.dtype
            assert (read[part] == array).all()
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


def test_classes_without_depth_are_kept_and_images_with_classes_counted(tmp_path: Path) -> None:
    kind = np.array([[0, 11], [UNKNOWN_KIND, 3]], np.uint8)
    views = {"CAM_FRONT": ViewTargets(None, kind), "CAM_BACK": ViewTargets(np.ones((2, 2), np.float16), kind)}
    save_view_targets(tmp_path / "one.npz", views)
    again = load_view_targets(tmp_path / "one.npz")
    assert again["CAM_FRONT"].depth_m is None
    assert again["CAM_BACK"].depth_m is not None
    assert (again["CAM_FRONT"].kind == kind).all()
    assert count_labelled_images(tmp_path / "one.npz") == 2
    whole = (tmp_path / "one.npz").read_bytes()
    for damaged in (b"no zip", whole.replace(b"PK\x01\x02", b"PK\x09\x09")):
        (tmp_path / "bad.npz").write_bytes(damaged)
        with pytest.raises(DataError, match="damaged depth and classes"):
            count_labelled_images(tmp_path / "bad.npz")


def test_classes_that_are_not_known_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ShapeError, match="expected classes below 12 or 255, got 12"):
        ViewTargets(None, np.array([[0, 12], [UNKNOWN_KIND, 3]], np.uint8))
    with zipfile.ZipFile(tmp_path / "odd.npz", "w") as archive, archive.open("CAM_FRONT.kind.npy", "w") as file:
        np.save(file, np.full((2, 2), 37, np.uint8))
    with pytest.raises(DataError, match=r"odd.npz: damaged depth and classes of pixels .*got 37"):
        load_view_targets(tmp_path / "odd.npz")


def test_targets_copy_their_arrays() -> None:
    depth, kind = np.ones((2, 3), np.float16), np.ones((2, 3), np.uint8)
    targets = ViewTargets(depth, kind)
    depth[:], kind[:] = 5, 5
    assert set(targets.arrays()) == {"depth_m", "kind"}
    for array in targets.arrays().values():
        assert (array == 1).all()
        assert not array.flags.writeable
