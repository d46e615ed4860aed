from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from panda_twin import PandaTwin

from appocc.errors import DataError
from appocc.pandaset import convert_folder, read_recordings
from appocc.pandaset.pickles import read_pickles
from appocc.pandaset.plain import read_plain

pd = pytest.importorskip("pandas")


@pytest.fixture
def twin(tmp_path: Path) -> PandaTwin:
    return PandaTwin(tmp_path)


def test_both_formats_give_the_same_recording(twin: PandaTwin) -> None:
    """The published yaw is the heading of the width axis, dimensions.x the width, points lie in the world."""
    plain, published = read_plain(twin.source, twin.lidar), read_pickles(twin.publish() / "002", None)
    assert published.name == plain.name == "002"
    assert published.label_names == plain.label_names
    for channel, intrinsic in plain.intrinsics.items():
        np.testing.assert_allclose(published.intrinsics[channel], intrinsic)
    assert [m.index for m in published.frames] == [m.index for m in plain.frames]
    for ours, theirs in zip(plain.frames, published.frames, strict=True):
        assert theirs.time_s == ours.time_s
        np.testing.assert_allclose(theirs.world_from_ego, ours.world_from_ego, atol=1e-6)
        assert theirs.images.keys() == ours.images.keys()
        for channel, image in ours.images.items():
            assert theirs.images[channel].time_s == image.time_s
            np.testing.assert_allclose(theirs.images[channel].world_from_cam, image.world_from_cam, atol=1e-6)
        for a, b in zip(ours.cuboids, theirs.cuboids, strict=True):
            assert (a.track, a.label, a.motion, a.sensor, a.sibling) == (
                b.track,
                b.label,
                b.motion,
                b.sensor,
                b.sibling,
            )
            np.testing.assert_allclose(b.centre_world_m, a.centre_world_m)
            np.testing.assert_allclose(b.size_lwh_m, a.size_lwh_m)
            assert b.yaw_world_rad == pytest.approx(a.yaw_world_rad)
        assert (theirs.read_sweep is None) == (ours.read_sweep is None)
        if ours.read_sweep and theirs.read_sweep:
            one, other = ours.read_sweep(), theirs.read_sweep()
            np.testing.assert_allclose(
                other.points_ego_m, one.points_ego_m, atol=1e-4
            )  # the forward LiDAR's are left out
            assert np.array_equal(other.intensity, one.intensity)
            assert one.labels is not None
            assert other.labels is not None
            assert np.array_equal(other.labels, one.labels)


def test_a_sequence_and_a_folder_of_sequences(twin: PandaTwin) -> None:
    published = twin.publish()
    assert [r.name for r in read_recordings(published / "002", None, True)] == ["002"]
    shutil.copytree(published / "002", published / "001")
    assert [r.name for r in read_recordings(published, None, True)] == ["001", "002"]
    summary = convert_folder(published, twin.root / "out", None, True, lambda _: None)
    assert summary["scenes"] == ["001", "002"]
    assert (summary["images"], summary["sweeps"]) == (36, 4)


@pytest.mark.parametrize("below", ["", "orig"])
def test_sweeps_that_lie_apart(twin: PandaTwin, below: str) -> None:
    sequence, apart = twin.publish() / "002", twin.root / "apart"
    (apart / below).mkdir(parents=True)
    (sequence / "lidar" / "02.pkl.gz").rename(apart / below / "02.pkl.gz")
    found = [frame.read_sweep is not None for frame in read_pickles(sequence, apart).frames]
    assert found == [False, True, False]


def test_labels_may_be_missing(twin: PandaTwin) -> None:
    sequence = twin.publish() / "002"
    (sequence / "annotations/semseg/00.pkl.gz").unlink()
    first = read_pickles(sequence, None).frames[0]
    assert first.read_sweep is not None
    assert first.read_sweep().labels is None


def rewrite(path: Path, change: Callable[[Any], object]) -> None:
    value = json.loads(path.read_text())
    change(value)
    path.write_text(json.dumps(value))


def retable(path: Path, change: Callable[[Any], Any]) -> None:
    change(pd.read_pickle(path)).to_pickle(path)


def no_images(sequence: Path) -> None:
    for path in sequence.glob("camera/*/*.jpg"):
        path.unlink()


BAD: dict[str, tuple[Callable[[Path], object], str]] = {
    "pose without heading": (
        lambda s: rewrite(s / "lidar/poses.json", lambda v: v[2].pop("heading")),
        r"KeyError\('heading'\)",
    ),
    "poses no objects": (lambda s: (s / "lidar/poses.json").write_text("[1, 2, 3, 4, 5, 6]"), r"TypeError"),
    "poses too few": (lambda s: rewrite(s / "lidar/poses.json", lambda v: v.pop()), r"ValueError"),
    "heading of no length": (
        lambda s: rewrite(s / "lidar/poses.json", lambda v: v[2].update(heading=dict.fromkeys("wxyz", 0.0))),
        r"quaternion wxyz: expected a length of 1",
    ),
    "camera times too many": (
        lambda s: rewrite(s / "camera/left_camera/timestamps.json", lambda v: v.append(1)),
        r"ValueError",
    ),
    "no intrinsics": (
        lambda s: (s / "camera/left_camera/intrinsics.json").unlink(),
        r"intrinsics\.json: cannot be read",
    ),
    "no images": (no_images, r"sequence 002: no frames"),
    "class names a list": (lambda s: (s / "annotations/semseg/classes.json").write_text("[]"), r"AttributeError"),
    "no cuboids": (lambda s: (s / "annotations/cuboids/02.pkl.gz").unlink(), r"02\.pkl\.gz: cannot be read"),
    "cuboids damaged": (
        lambda s: (s / "annotations/cuboids/02.pkl.gz").write_bytes(b"nothing"),
        r"02\.pkl\.gz: cannot be unpickled",
    ),
    "cuboids no table": (lambda s: pd.to_pickle(7, s / "annotations/cuboids/02.pkl.gz"), r"AttributeError"),
    "cuboids without yaw": (
        lambda s: retable(s / "annotations/cuboids/02.pkl.gz", lambda t: t.drop(columns="yaw")),
        r"KeyError\('yaw'\)",
    ),
    "points no table": (
        lambda s: pd.to_pickle([1], s / "lidar/02.pkl.gz"),
        r"lidar/02\.pkl\.gz: not a PandaSet point table",
    ),
    "points without height": (
        lambda s: retable(s / "lidar/02.pkl.gz", lambda t: t.drop(columns="z")),
        r"lidar/02\.pkl\.gz: not a PandaSet point table",
    ),
    "labels too few": (
        lambda s: retable(s / "annotations/semseg/02.pkl.gz", lambda t: t.iloc[:-1]),
        r"semseg/02\.pkl\.gz: expected 365 labels, one per point, got 364",
    ),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_sequences(twin: PandaTwin, name: str) -> None:
    change, message = BAD[name]
    published = twin.publish()
    change(published / "002")
    with pytest.raises(DataError, match=message) as caught:
        convert_folder(published, twin.root / "out", None, True, lambda _: None)
    assert "\n" not in str(caught.value)
    assert not (twin.root / "out").exists()


def test_no_sequence_at_all(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"no published PandaSet sequence \(expected camera/, lidar/, annotations/\)"):
        read_recordings(tmp_path, None, True)


def test_pandas_is_named_where_it_is_missing(twin: PandaTwin, monkeypatch: pytest.MonkeyPatch) -> None:
    published = twin.publish()
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(DataError, match=r"reading pickles needs pandas: pip install '\.\[pandaset\]'"):
        read_pickles(published / "002", None)
