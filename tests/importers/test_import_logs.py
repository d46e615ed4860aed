from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import pytest

from appocc.doctor import contents_of
from appocc.ego_vehicle import EgoVehicle
from appocc.errors import DataError
from appocc.files import write_image
from appocc.geometry import transform
from appocc.importers import Frame, Image, Summary, Sweep, import_logs, key_indices
from appocc.lenses import DistortedLens
from appocc.nuscenes import Dataset
from appocc.nuscenes.maps import mask_window
from appocc.nuscenes.validate import validate
from appocc.nuscenes.view_targets import ViewClass, load_view_targets, view_targets_path
from appocc.nuscenes.writer import Annotation, Writer
from appocc.rigs import SourceRig
from appocc.rigs.cutting import cut_views
from appocc.rigs.source_camera import SourceCamera
from appocc.workers import worker_pool

SIZE, EGO = (64, 48), EgoVehicle()


@dataclass(frozen=True)
class MadeLog:
    """Three key frames ahead at 5 m/s with a pinhole and a distorted camera, a sweep and a box."""

    name: str = "log-a"
    description: str = "made"
    vehicle: str = "made"
    location: str = "nowhere"
    frames_in_total: int = 3
    broken: str = ""
    stop_after: int = 99

    def rig(self) -> SourceRig:
        intrinsic = np.array([[50.0, 0, 31.5], [0, 50.0, 23.5], [0, 0, 1]])
        ahead = transform(np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]]), [1.5, 0, 1.6])
        lenses = {"front": np.zeros(4), "wide": np.array([-0.2, 0.05, 0, 0])}
        cameras = tuple(
            SourceCamera(name, f"CAM_{name.upper()}", *SIZE, DistortedLens(intrinsic, k), ahead)
            for name, k in lenses.items()
        )
        return SourceRig(cameras, tuple(view for camera in cameras for view in cut_views(camera)), EGO)

    def ego_from_lidar(self) -> np.ndarray:
        return transform(np.eye(3), [0, 0, 1.8])

    def frames(self) -> Iterator[Frame]:
        for index in range(3):
            if index == self.stop_after:
                raise KeyboardInterrupt
            time_us = 1_600_000_000_000_000 + index * 500_000
            pose = transform(np.eye(3), [2.5 * index, 0, 0])
            images = tuple(
                Image(name, time_us, pose, partial(self._jpeg, name), partial(self._kinds, index))
                for name in ("front", "wide")
            )
            box = Annotation(
                instance="car-1",
                category="vehicle.car",
                world_from_box=transform(np.eye(3), [20.0, 2, 0.8]),
                size_wlh_m=(1.9, 4.5, 1.6),
            )
            sweep = Sweep(time_us, pose, lambda: np.array([[10.0, 0, -1.8, 20, -1]]))
            yield Frame(time_us, images, sweep, (box,))

    def write_map(self, writer: Writer, log: str) -> None:
        pass

    def notes(self) -> tuple[str, ...]:
        return ("no map",)

    def _kinds(self, index: int) -> np.ndarray | None:
        """Sky, and terrain in the right half; of the second frame alone."""
        kinds = np.zeros(SIZE[::-1], np.uint8)
        kinds[:, SIZE[0] // 2 :] = ViewClass.TERRAIN
        return kinds if index == 1 else None

    def _jpeg(self, name: str) -> bytes:
        data = cv2.imencode(".jpg", np.full((SIZE[1], SIZE[0], 3), 90, np.uint8))[1].tobytes()
        return data[:60] if name == self.broken else data


def contents(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def imported(out: Path, *logs: MadeLog, workers: int = 1) -> Summary:
    with worker_pool(workers) as pool:
        return import_logs(logs, out, "made", {"hz": 2}, pool)


def test_logs_become_a_valid_dataset(tmp_path: Path) -> None:
    summary = imported(tmp_path / "out", MadeLog(), MadeLog("log-b"))
    assert (summary.samples, summary.images, summary.sweeps, summary.boxes) == (6, 12, 6, 6)
    assert summary.notes == ["no map"]
    assert summary.pixel_classes == 4
    dataset = Dataset(tmp_path / "out")
    assert [scene.name for scene in dataset.scenes] == ["log-a", "log-b"]
    frame = dataset.frame(dataset.samples(dataset.scenes[1])[2])
    assert set(frame.images) == {"CAM_FRONT", "CAM_WIDE"}
    assert len(list((dataset.root / "views").iterdir())) == 2
    views = load_view_targets(view_targets_path(dataset.root, dataset.samples(dataset.scenes[1])[1].token))
    assert views["CAM_FRONT"].kind.tolist() == [[0, 0, 0, 0, 4, 4, 4, 4]] * 6
    assert set(np.unique(views["CAM_WIDE"].kind)) == {0, 4}
    assert not validate(dataset)


def test_a_jpeg_of_a_pinhole_keeps_its_bytes(tmp_path: Path) -> None:
    imported(tmp_path / "out", MadeLog())
    kept = next((tmp_path / "out/samples/CAM_FRONT").iterdir())
    assert kept.read_bytes() == MadeLog()._jpeg("front")


def test_the_pool_and_interruptions_do_not_change_a_byte(tmp_path: Path) -> None:
    logs = (MadeLog(), MadeLog("log-b"), MadeLog("log-c"))
    imported(tmp_path / "one", *logs)
    imported(tmp_path / "two", *logs, workers=2)
    with pytest.raises(KeyboardInterrupt):
        imported(tmp_path / "three", logs[0], replace(logs[1], stop_after=1), logs[2])
    assert not (tmp_path / "three").exists()
    imported(tmp_path / "three", *logs)
    assert contents(tmp_path / "one") == contents(tmp_path / "two") == contents(tmp_path / "three")
    assert [path.name for path in sorted(tmp_path.iterdir())] == ["one", "three", "two"]


def test_logs_without_a_map_are_read_by_the_devkit_and_have_no_mask(tmp_path: Path) -> None:
    nuscenes = pytest.importorskip("nuscenes", reason="nuscenes-devkit is not installed")
    imported(tmp_path / "out", MadeLog(), MappedLog("log-b"))
    kit = nuscenes.NuScenes("v1.0-made", str(tmp_path / "out"), verbose=False)
    assert len(kit.scene) == 2
    assert all(Path(row["mask"].img_file).is_file() for row in kit.map)
    dataset = Dataset(tmp_path / "out")
    bare, mapped = dataset.scenes
    assert dataset.map_record(bare) is None
    assert mask_window(dataset, bare, np.full(2, -20.0), np.full(2, 20.0)) is None
    assert dataset.map_record(mapped) is not None
    contents = contents_of(dataset)
    assert (contents.masks, contents.scenes_with_mask) == (1, 1)
    assert not validate(dataset)


def test_a_damaged_image_is_missing_and_told(tmp_path: Path) -> None:
    summary = imported(tmp_path / "out", replace(MadeLog(), broken="front"))
    assert summary.images == 3
    assert summary.missing == {"front": 3}
    assert "truncated" in summary.damaged[0]


def test_bad_calls_leave_nothing(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="several of 'log-a'"):
        imported(tmp_path / "out", MadeLog(), MadeLog())
    with pytest.raises(DataError, match="at least one recording"):
        imported(tmp_path / "out")
    with pytest.raises(DataError, match="at least one key frame"):
        imported(tmp_path / "out", EmptyLog())
    assert not list(tmp_path.iterdir())


class MappedLog(MadeLog):
    def write_map(self, writer: Writer, log: str) -> None:
        write_image(writer.root / "maps/own.png", np.full((400, 400), 255, np.uint8))
        writer.add("map", "own", category="semantic_prior", filename="maps/own.png", log_tokens=[log])


class EmptyLog(MadeLog):
    def frames(self) -> Iterator[Frame]:
        return iter(())


@pytest.mark.parametrize(
    ("hz", "expected"), [(2, [0, 5, 10]), (10, list(range(11))), (4, [0, 2, 5, 7, 10]), (100, list(range(11)))]
)
def test_key_frames_at_a_rate(hz: float, expected: list[int]) -> None:
    indices = key_indices(np.arange(11) * 100_000, hz)
    assert len(indices) == len(expected)
    assert np.abs(indices - expected).max() <= 1


def test_key_frames_after_a_gap() -> None:
    assert key_indices(np.array([0, 100, 200, 5000, 5100]) * 1000, 2).tolist() == [0, 3]
