from __future__ import annotations

import gzip
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from panda_twin import PandaTwin, world_from_ego

from appocc.errors import DataError
from appocc.pandaset import convert_folder, read_recordings
from appocc.pandaset.plain import read_plain

Change = Callable[[dict[str, Any]], object]


@pytest.fixture
def twin(tmp_path: Path) -> PandaTwin:
    return PandaTwin(tmp_path)


def front(data: dict[str, Any]) -> Any:
    return data["frames"][2]["cameras"]["front_camera"]


def box(data: dict[str, Any]) -> Any:
    return data["frames"][2]["boxes"][0]


BAD: dict[str, tuple[Change, str]] = {
    "no frames": (lambda d: d.pop("frames"), r"'frames'"),
    "frames empty": (lambda d: d["frames"].clear(), r"IndexError"),
    "frames no list": (lambda d: d.update(frames=7), r"TypeError"),
    "no intrinsics": (lambda d: d.pop("intrinsics"), r"'intrinsics'"),
    "intrinsics no object": (lambda d: d.update(intrinsics=[]), r"AttributeError"),
    "intrinsics ragged": (lambda d: d["intrinsics"].update(front_camera=[[1, 2], [3]]), r"ValueError"),
    "intrinsics small": (
        lambda d: d["intrinsics"].update(front_camera=[[1.0]]),
        r"CAM_FRONT intrinsic: expected shape",
    ),
    "intrinsics NaN": (
        lambda d: d["intrinsics"].update(front_camera=[[float("nan"), 0, 1], [0, 1, 1], [0, 0, 1]]),
        r"CAM_FRONT intrinsic: expected finite numbers",
    ),
    "intrinsics without depth": (
        lambda d: d["intrinsics"].update(front_camera=[[1, 0, 0], [0, 1, 0], [0, 0, 0]]),
        r"CAM_FRONT intrinsic: expected last row \[0, 0, 1\]",
    ),
    "intrinsics missing": (
        lambda d: d["intrinsics"].pop("left_camera"),
        r"CAM_LEFT has images but no intrinsic matrix",
    ),
    "unknown camera": (lambda d: d["intrinsics"].update(roof_camera=[]), r"'roof_camera'"),
    "no time": (lambda d: d["frames"][2].pop("t_lidar"), r"'t_lidar'"),
    "time no number": (lambda d: d["frames"][2].update(t_lidar="soon"), r"ValueError.*soon"),
    "time NaN": (
        lambda d: d["frames"][2].update(t_lidar=float("nan")),
        r"frame 2 time: expected seconds since 1970, got nan",
    ),
    "time before 1970": (lambda d: d["frames"][2].update(t_lidar=-5), r"expected seconds since 1970, got -5"),
    "number infinite": (lambda d: d["frames"][2].update(i=float("inf")), r"OverflowError"),
    "time back": (lambda d: d["frames"][4].update(t_lidar=1.0), r"times of the frames do not increase"),
    "no camera time": (lambda d: front(d).pop("t"), r"'t'"),
    "camera time NaN": (
        lambda d: front(d).update(t=float("inf")),
        r"02\.jpg time: expected seconds since 1970, got inf",
    ),
    "no camera pose": (lambda d: front(d).pop("T_world_cam"), r"'T_world_cam'"),
    "camera pose NaN": (
        lambda d: front(d)["T_world_cam"][0].__setitem__(3, float("nan")),
        r"T_world_cam: expected finite",
    ),
    "camera pose small": (lambda d: front(d).update(T_world_cam=[[1.0]]), r"T_world_cam: expected shape \(4, 4\)"),
    "ego pose skew": (
        lambda d: d["frames"][2].update(T_world_ego=(np.eye(4) * [2, 1, 1, 1]).tolist()),
        r"T_world_ego: expected a rotation",
    ),
    "ego pose ragged": (lambda d: d["frames"][2].update(T_world_ego=[[1], [2, 3]]), r"ValueError"),
    "no file": (lambda d: front(d).pop("file"), r"'file'"),
    "file elsewhere": (lambda d: front(d).update(file="../../etc/passwd"), r"leads out of this folder"),
    "file absolute": (lambda d: front(d).update(file="/etc/passwd"), r"leads out of this folder"),
    "file gone": (lambda d: front(d).update(file="002/none.jpg"), r"none\.jpg: cannot be read \(No such file"),
    "sweep of another name": (
        lambda d: d["frames"][2].update(lidar_npz="../../etc/passwd"),
        r"frame 2: lidar_npz: expected a path to 02\.npz, got '\.\./\.\./etc/passwd'",
    ),
    "sweep of another frame": (
        lambda d: d["frames"][2].update(lidar_npz="npz/00.npz"),
        r"expected a path to 02\.npz",
    ),
    "no boxes": (lambda d: d["frames"][0].pop("boxes"), r"'boxes'"),
    "box without yaw": (lambda d: box(d).pop("yaw_world"), r"'yaw_world'"),
    "box yaw NaN": (lambda d: box(d).update(yaw_world=float("nan")), r"cuboid car yaw: expected finite"),
    "box place NaN": (
        lambda d: box(d).update(centre_world=[1, float("nan"), 2]),
        r"cuboid car centre: expected finite",
    ),
    "box place short": (lambda d: box(d).update(centre_world=[1, 2]), r"cuboid car centre: expected shape"),
    "box flat": (lambda d: box(d).update(size_lwh=[4, 0, 1]), r"cuboid car size: expected positive sizes, got \[4"),
    "box class": (
        lambda d: box(d).update({"class": "Spaceship"}),
        r"frames\.json: PandaSet has no class 'Spaceship'",
    ),
    "box sensor": (lambda d: box(d).update(sensor_id=None), r"TypeError"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_frames(twin: PandaTwin, name: str) -> None:
    change, message = BAD[name]
    change(twin.data)
    twin.write()
    before = sorted(path.name for path in twin.root.iterdir())
    with pytest.raises(DataError, match=message) as caught:
        convert_folder(twin.source, twin.root / "out", twin.lidar, False, lambda _: None)
    assert "\n" not in str(caught.value)
    assert sorted(path.name for path in twin.root.iterdir()) == before  # no OUT, nothing half-written


def spoil(path: Path, data: bytes) -> None:
    assert path.is_file()
    path.write_bytes(data)


def reshaped(twin: PandaTwin, **parts: np.typing.NDArray[Any]) -> None:
    np.savez_compressed(twin.lidar / "npz" / "02.npz", **{**twin.sweeps[2], **parts})


BAD_FILES: dict[str, tuple[Callable[[PandaTwin], object], str]] = {
    "json": (lambda t: spoil(t.source / "frames.json", b'{"frames": ['), r"frames\.json: no valid JSON"),
    "json list": (lambda t: spoil(t.source / "frames.json", b"[]"), r"frames\.json: not a plain copy"),
    "image gone": (
        lambda t: (t.source / "002/camera/left_camera/02.jpg").unlink(),
        r"left_camera/02\.jpg: cannot be read",
    ),
    "image empty": (
        lambda t: spoil(t.source / "002/camera/left_camera/02.jpg", b""),
        r"left_camera/02\.jpg: not a readable",
    ),
    "image cut": (
        lambda t: spoil(t.source / "002/camera/left_camera/02.jpg", b"\xff\xd8" + bytes(300)),
        r"left_camera/02\.jpg: the image is truncated",
    ),
    "sweep gone": (lambda t: (t.lidar / "npz/02.npz").unlink(), r"npz/02\.npz: cannot be read \(No such file"),
    "sweep cut": (
        lambda t: spoil(t.lidar / "npz/02.npz", (t.lidar / "npz/02.npz").read_bytes()[:500]),
        r"npz/02\.npz: damaged sweep",
    ),
    "sweep damaged": (
        lambda t: spoil(t.lidar / "npz/02.npz", (t.lidar / "npz/02.npz").read_bytes().replace(b"\x00", b"\x01", 40)),
        r"npz/02\.npz: damaged sweep",
    ),
    "sweep of other shape": (
        lambda t: reshaped(t, xyz_cm_ego=np.zeros((325, 2), np.int16)),
        r"02\.npz: damaged sweep \(points",
    ),
    "sweep short of intensity": (
        lambda t: reshaped(t, intensity=np.zeros(3, np.uint8)),
        r"intensity: expected shape \(325\)",
    ),
    "sweep of wide labels": (
        lambda t: reshaped(t, semseg=np.zeros(325, np.int16)),
        r"labels: expected uint8, got int16",
    ),
    "road damaged": (lambda t: spoil(t.source / "road_world.npz", b"PK"), r"road_world\.npz: damaged road raster"),
    "classes list": (lambda t: spoil(t.source / "002/annotations/semseg/classes.json", b"[1]"), r"AttributeError"),
    "classes beyond a byte": (
        lambda t: spoil(t.source / "002/annotations/semseg/classes.json", b'{"300": "Road"}'),
        r"expected point labels 0\.\.255, got 300",
    ),
    "class unknown": (
        lambda t: spoil(t.source / "002/annotations/semseg/classes.json", b'{"7": "Lava"}'),
        r"PandaSet has no class 'Lava'",
    ),
}


@pytest.mark.parametrize("name", BAD_FILES)
def test_bad_files(twin: PandaTwin, name: str) -> None:
    change, message = BAD_FILES[name]
    change(twin)
    with pytest.raises(DataError, match=message) as caught:
        convert_folder(twin.source, twin.root / "out", twin.lidar, False, lambda _: None)
    assert "\n" not in str(caught.value)
    assert sorted(path.name for path in twin.root.iterdir()) == ["panda", "panda_lidar"]


def test_frames_without_images_are_skipped(twin: PandaTwin) -> None:
    recording = read_plain(twin.source, twin.lidar)
    assert [frame.index for frame in recording.frames] == [0, 2, 4]
    assert [frame.read_sweep is not None for frame in recording.frames] == [True, True, False]
    assert recording.source == "made by hand"
    np.testing.assert_allclose(recording.frames[1].world_from_ego, world_from_ego(0.2), atol=2e-6)


def test_rounded_poses_become_rigid(twin: PandaTwin) -> None:
    for frame in read_plain(twin.source, None).frames:
        for pose in (frame.world_from_ego, *(image.world_from_cam for image in frame.images.values())):
            assert np.abs(pose[:3, :3] @ pose[:3, :3].T - np.eye(3)).max() < 1e-12


def test_missing_folders(twin: PandaTwin) -> None:
    for source, lidar in ((twin.root / "none", None), (twin.source, twin.root / "none")):
        with pytest.raises(DataError, match=r"none: no such folder"):
            read_recordings(source, lidar, False)


class _Plant:
    """Pickled, it creates a file when it is opened."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[Any, ...]:
        return (Path.touch, (self.path,))


def plant(target: Path, marker: Path) -> None:
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_bytes(gzip.compress(pickle.dumps(_Plant(marker))))


def test_no_pickle_is_opened_unless_trusted(twin: PandaTwin) -> None:
    pytest.importorskip("pandas")
    published, marker = twin.publish(), twin.root / "opened"
    for folder in (published, twin.source):
        plant(folder / "002/annotations/cuboids/00.pkl.gz", marker)
        plant(folder / "002/annotations/semseg/00.pkl.gz", marker)
        plant(folder / "002/lidar/00.pkl.gz", marker)
        plant(twin.lidar / "orig/00.pkl.gz", marker)
    with pytest.raises(DataError, match=r"no frames\.json; published pickles are read only with --trust-pickles"):
        convert_folder(published, twin.root / "out", None, False, lambda _: None)
    convert_folder(twin.source, twin.root / "out", twin.lidar, False, lambda _: None)
    assert not marker.exists()
    with pytest.raises(DataError):  # the plant is a live one
        convert_folder(published, twin.root / "other", None, True, lambda _: None)
    assert marker.exists()
    assert not (twin.root / "other").exists()


def test_arrays_of_objects_are_not_unpickled(twin: PandaTwin) -> None:
    """An npz can hold pickles too."""
    marker = twin.root / "opened"
    reshaped(twin, semseg=np.array([_Plant(marker)] * 325, dtype=object))
    with pytest.raises(DataError, match=r"02\.npz: damaged sweep"):
        convert_folder(twin.source, twin.root / "out", twin.lidar, False, lambda _: None)
    assert not marker.exists()
