from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from made_own_recording import write_cameras, write_video

from appocc.checks import ByteArray, FloatArray
from appocc.errors import DataError
from appocc.files import write_image
from appocc.frame import Frame
from appocc.geometry import transform
from appocc.own_cameras import CameraDevices, Clock, LiveFrames, WatchedFolder
from appocc.own_cameras.pictures import Picture
from appocc.rigs import read_source_rig
from appocc.rigs.source_rig import SourceRig
from appocc.trajectory import Straight

START_US = 1_700_000_000_000_000
GREY = np.full((32, 48, 3), 90, np.uint8)
RIG = """
cameras:
  front: {size_px: [48, 32], fov_deg: 90, position_m: [1.7, 0, 1.5], yaw_deg: 0}
  back: {size_px: [48, 32], fov_deg: 90, position_m: [0, 0, 1.5], yaw_deg: 180}
"""


@pytest.fixture
def rig(tmp_path: Path) -> SourceRig:
    (tmp_path / "rig.yaml").write_text(RIG)
    return read_source_rig(tmp_path / "rig.yaml")


def picture(camera: str, time_ms: int, image: ByteArray = GREY) -> Picture:
    return Picture(camera, START_US + 1000 * time_ms, lambda: image)


def damaged(camera: str, time_ms: int) -> Picture:
    def read() -> ByteArray:
        raise DataError("damaged")

    return Picture(camera, START_US + 1000 * time_ms, read)


def told(frames: list[Frame]) -> list[tuple[int, list[str]]]:
    """(milliseconds, channels with an image) of frames."""
    return [((frame.timestamp_us - START_US) // 1000, sorted(frame.images)) for frame in frames]


def test_frames_come_with_the_cameras_that_sent_a_picture(rig: SourceRig) -> None:
    source = [
        picture("front", 0),
        picture("back", 1),
        picture("front", 100),
        picture("front", 200),
        picture("back", 200),
    ]
    frames = list(LiveFrames(source, rig))
    assert told(frames) == [(1, ["CAM_BACK", "CAM_FRONT"]), (100, ["CAM_FRONT"]), (200, ["CAM_BACK", "CAM_FRONT"])]
    assert frames[1].rig == rig.rig


def test_late_and_out_of_order_pictures_are_skipped_and_counted(rig: SourceRig) -> None:
    source = [
        picture("front", 0),
        picture("front", 400),  # the patience with the rear camera is 200 ms
        picture("back", 5),  # late
        picture("back", 400),
        picture("front", 300),  # out of order
        picture("front", 500),
        picture("back", 501),
    ]
    live = LiveFrames(source, rig)
    assert told(list(live)) == [
        (0, ["CAM_FRONT"]),
        (400, ["CAM_BACK", "CAM_FRONT"]),
        (501, ["CAM_BACK", "CAM_FRONT"]),
    ]
    assert live.skipped == {"late": 1, "out of order": 1}


def test_a_late_camera_is_waited_for(rig: SourceRig) -> None:
    source = [picture("front", 0), picture("front", 100), picture("back", 0), picture("back", 100)]
    assert told(list(LiveFrames(source, rig))) == [(0, ["CAM_BACK", "CAM_FRONT"]), (100, ["CAM_BACK", "CAM_FRONT"])]


def test_damaged_pictures_and_unknown_poses(rig: SourceRig) -> None:
    class Known:
        def at(self, time_us: int) -> FloatArray | None:
            return transform(np.eye(3), [1.0, 2.0, 0.0]) if time_us >= START_US + 100_000 else None

    source = [picture("front", 0), picture("front", 100), damaged("back", 100), damaged("front", 200)]
    live = LiveFrames(source, rig, Known())
    frames = list(live)
    assert told(frames) == [(100, ["CAM_FRONT"])]
    np.testing.assert_array_equal(frames[0].world_from_ego[:3, 3], [1, 2, 0])
    assert live.skipped == {"no pose": 1, "damaged": 2, "empty": 1}


def test_cameras_move_between_the_pictures_of_a_frame(rig: SourceRig) -> None:
    source = [picture("front", 0), picture("back", 40)]
    (frame,) = LiveFrames(source, rig, Straight(10.0, START_US))
    assert frame.timestamp_us == START_US + 40_000
    np.testing.assert_allclose(frame.rig["CAM_FRONT"].ego_from_cam[:3, 3], [1.3, 0, 1.5], atol=1e-9)
    np.testing.assert_allclose(frame.rig["CAM_BACK"].ego_from_cam[:3, 3], [0, 0, 1.5], atol=1e-9)


def test_the_rate_can_be_limited(rig: SourceRig) -> None:
    source = [picture(camera, time) for time in range(0, 1000, 100) for camera in ("front", "back")]
    live = LiveFrames(source, rig, hz=4)
    assert [time for time, _ in told(list(live))] == [0, 300, 600, 900]
    assert live.skipped == {"too soon": 6}


def test_a_watched_folder(tmp_path: Path, rig: SourceRig) -> None:
    folder = write_cameras(tmp_path / "new", rig.names, ["000", "001"], lambda camera, number: GREY)
    watched = WatchedFolder(folder, rig.names, Clock(10.0), poll_s=0.001, idle_s=0.5)
    frames = iter(LiveFrames(watched, rig))
    assert len(next(frames).images) == 2
    assert len(next(frames).images) == 2
    write_image(folder / "front" / "007.jpg", GREY)
    last = next(frames)
    assert (last.timestamp_us, list(last.images)) == (700_000, ["CAM_FRONT"])
    assert list(frames) == []


def test_a_file_is_taken_when_it_is_complete(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = write_cameras(tmp_path / "new", ["front"], ["0.0"], lambda camera, number: GREY)
    path = folder / "front" / "0.0.png"
    whole = path.read_bytes()
    path.write_bytes(whole[:50])
    pieces = iter((whole[:100], whole[:200], whole, whole, whole, whole))

    def grow(seconds: float) -> None:
        path.write_bytes(next(pieces))

    monkeypatch.setattr("appocc.own_cameras.live.time.sleep", grow)
    first = next(iter(WatchedFolder(folder, ["front"])))
    np.testing.assert_array_equal(first.read(), GREY)
    with pytest.raises(DataError, match="no such folder"):
        WatchedFolder(tmp_path / "none", ["front"])


def test_devices_give_the_newest_picture_of_each_camera(tmp_path: Path, rig: SourceRig) -> None:
    frames = [np.full((32, 48, 3), 20 * n, np.uint8) for n in range(1, 11)]
    devices: dict[str, int | str] = {
        name: str(write_video(tmp_path / f"{name}.avi", frames, 10.0)) for name in rig.names
    }
    source = CameraDevices(devices)
    pictures = list(source)
    for name in rig.names:
        own = [p for p in pictures if p.camera == name]
        assert len(own) + source.dropped[name] == 10
        assert [p.time_us for p in own] == sorted(p.time_us for p in own)
        assert round(float(own[-1].read().mean()), -1) == 200


def test_devices_are_closed_when_the_reader_stops(tmp_path: Path) -> None:
    video = write_video(tmp_path / "front.avi", [GREY] * 50, 10.0)
    pictures = iter(CameraDevices({"front": str(video)}))
    assert next(pictures).camera == "front"
    pictures.close()  # type: ignore[attr-defined]
    assert list(pictures) == []


def test_a_device_that_does_not_open_is_named(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"front: the device .*none.avi cannot be opened"):
        list(CameraDevices({"front": str(tmp_path / "none.avi")}))
