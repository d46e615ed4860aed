from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from made_own_recording import write_cameras, write_video

from appocc.checks import ByteArray
from appocc.errors import DataError
from appocc.own_cameras.pictures import Clock, find_streams, in_order_of_time

CAMERAS = ("CAM_FRONT", "CAM_BACK")


def grey(camera: str, number: int) -> ByteArray:
    """An image whose grey tells camera and number."""
    return np.full((32, 48, 3), 10 + 100 * CAMERAS.index(camera) + 10 * number, np.uint8)


def seen(
    source: Path, clock: Clock | None = None, mosaic: tuple[int, int] | None = None
) -> list[tuple[str, int, int]]:
    """(camera, time, grey) of all pictures."""
    streams = find_streams(source, CAMERAS, clock or Clock(), mosaic)
    return [(p.camera, p.time_us, round(float(p.read().mean()))) for p in in_order_of_time(streams)]


EXPECTED = [
    ("CAM_FRONT", 0, 10),
    ("CAM_BACK", 0, 110),
    ("CAM_FRONT", 100_000, 20),
    ("CAM_BACK", 100_000, 120),
]


def near(found: list[tuple[str, int, int]]) -> list[tuple[str, int, int]]:
    """Grey rounded to tens: videos are compressed."""
    return [(camera, time, round(value, -1)) for camera, time, value in found]


def test_a_folder_for_each_camera(tmp_path: Path) -> None:
    write_cameras(tmp_path, CAMERAS, ["0.0", "0.1"], grey)
    assert seen(tmp_path) == EXPECTED


def test_frame_numbers_with_a_rate_and_a_start(tmp_path: Path) -> None:
    write_cameras(tmp_path, CAMERAS, ["000", "001"], grey)
    later = [(camera, time + 3_000_000, value) for camera, time, value in EXPECTED]
    assert seen(tmp_path, Clock(10.0, 3_000_000)) == later


def test_one_folder_for_all_cameras(tmp_path: Path) -> None:
    for camera in CAMERAS:
        write_cameras(tmp_path, [camera], ["0.0", "0.1"], grey)
        for path in (tmp_path / camera).iterdir():
            path.rename(tmp_path / f"{camera}_{path.name}")
        (tmp_path / camera).rmdir()
    assert seen(tmp_path) == EXPECTED


def test_a_folder_for_each_time(tmp_path: Path) -> None:
    write_cameras(tmp_path / "flat", CAMERAS, ["000", "001"], grey)
    for path in sorted((tmp_path / "flat").glob("*/*.png")):
        (tmp_path / "drive" / path.stem).mkdir(parents=True, exist_ok=True)
        path.rename(tmp_path / "drive" / path.stem / f"{path.parent.name}.png")
    assert seen(tmp_path / "drive", Clock(10.0)) == EXPECTED


def test_a_longer_name_is_another_camera(tmp_path: Path) -> None:
    write_cameras(tmp_path, CAMERAS, ["0.0", "0.1"], grey)
    (tmp_path / "CAM_FRONT").rename(tmp_path / "hidden")
    for path in (tmp_path / "hidden").iterdir():
        path.rename(tmp_path / f"CAM_FRONT_LEFT_{path.name}")
    with pytest.raises(
        DataError, match=r"no pictures of CAM_FRONT: expected CAM_FRONT/, TIME/CAM_FRONT.jpg, CAM_FRONT_"
    ):
        seen(tmp_path)


@pytest.mark.parametrize("ending", [".avi", ".mp4", ".webm"])
def test_videos_with_their_own_times(tmp_path: Path, ending: str) -> None:
    for camera in CAMERAS:
        write_video(tmp_path / f"{camera}{ending}", [grey(camera, 0), grey(camera, 1)], 10.0)
    assert near(seen(tmp_path)) == EXPECTED


def test_a_video_named_by_its_start_and_a_list_of_times(tmp_path: Path) -> None:
    write_video(tmp_path / "CAM_FRONT_1700000000.5.avi", [grey("CAM_FRONT", 0), grey("CAM_FRONT", 1)], 5.0)
    write_video(tmp_path / "CAM_BACK.avi", [grey("CAM_BACK", 0), grey("CAM_BACK", 1)], 5.0)
    (tmp_path / "CAM_BACK.txt").write_text("1700000000.6\n1700000000.9\n")
    times = [time - 1_700_000_000_000_000 for _, time, _ in seen(tmp_path)]
    assert times == [500_000, 600_000, 700_000, 900_000]


def test_a_mosaic_shows_the_cameras_row_by_row(tmp_path: Path) -> None:
    frames = [np.vstack([grey("CAM_FRONT", n), grey("CAM_BACK", n)]) for n in range(2)]
    video = write_video(tmp_path / "all.avi", frames, 10.0)
    assert near(seen(video, mosaic=(2, 1))) == EXPECTED


def test_the_clock_of_streams(tmp_path: Path) -> None:
    write_cameras(tmp_path / "a", CAMERAS, ["0.0", "0.1"], grey)
    write_video(tmp_path / "b.avi", [grey("CAM_FRONT", n) for n in range(3)], 4.0)
    files = find_streams(tmp_path / "a", CAMERAS, Clock(), None)[0]
    assert files.clock(5).tolist() == [0, 100_000]
    mosaic = find_streams(tmp_path / "b.avi", CAMERAS[:1], Clock(None, 7), (1, 1))[0]
    assert mosaic.clock(2).tolist() == [7, 250_007]


def test_damaged_sources_are_refused(tmp_path: Path) -> None:
    def why(match: str, source: Path = tmp_path, mosaic: tuple[int, int] | None = None) -> None:
        with pytest.raises(DataError, match=match):
            seen(source, mosaic=mosaic)

    why("no such folder", tmp_path / "none")
    why("no pictures of CAM_FRONT")
    write_cameras(tmp_path, CAMERAS, ["0.0"], grey)
    video = write_video(tmp_path / "all.avi", [grey("CAM_FRONT", 0)], 10.0)
    why("needs --mosaic", video)
    why("expected at least 2 places, got 1", video, (1, 1))
    why("3 rows and 1 columns of equal size", video, (3, 1))
    (tmp_path / "broken.mp4").write_bytes(b"no video")
    why("cannot be opened as a video", tmp_path / "broken.mp4", (1, 2))
    (tmp_path / "CAM_FRONT" / "0.00.png").write_bytes((tmp_path / "CAM_FRONT" / "0.0.png").read_bytes())
    why(r"0\.0\.png and 0\.00\.png have the same time")
    (tmp_path / "CAM_FRONT.txt").write_text("1.0\n0.5\n")
    why(r"CAM_FRONT.txt:2: expected a time after 1.00 s")
    (tmp_path / "CAM_FRONT.txt").write_text("1.0\n")
    why("expected 1 pictures, as CAM_FRONT.txt has times, got 2")
    (tmp_path / "CAM_FRONT.txt").write_text("noon\n")
    why(r"CAM_FRONT.txt:1: expected a time in seconds or of ISO 8601, such as .*, got 'noon'")
