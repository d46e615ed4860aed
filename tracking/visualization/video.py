"""Track video: the cameras as they are mounted around the car, a list of tracks, and the bird's-eye view."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import cv2
import numpy as np

from appocc.bevmap import BEVMap, load_map
from appocc.checks import ByteArray, FloatArray
from appocc.errors import DataError
from appocc.files import whole_file
from appocc.frame import Frame
from appocc.nuscenes import Dataset
from appocc.visualization.cameras import camera_rows
from tracking.pipeline import SceneTracks
from tracking.tracks import Track
from tracking.visualization.panels import draw_bev_panel, draw_camera_panel, draw_list_panel

_CAMERAS_PX = 1440
TRAIL_S = 4.0


def write_video(
    dataset: Dataset, result: SceneTracks, path: Path, advance: Callable[[int], None] = lambda _: None
) -> None:
    """Write a VP8 video (.webm, for browsers) of the key frames in real time, atomically.

    `advance` is called with 1 after each key frame.

    Raises:
        DataError: if the path does not end in .webm, a map or image is missing, or the video cannot be written.
    """
    check_video_path(path)
    with whole_file(path) as temporary:
        writer: cv2.VideoWriter | None = None
        try:
            for number, sample in enumerate(result.samples):
                bev = load_map(dataset.root, result.source, sample.token)
                picture = draw_frame(result, number, dataset.frame(sample), bev)
                writer = writer or _open(temporary, picture, _rate_hz(result))
                writer.write(cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))
                advance(1)
        finally:
            if writer is not None:
                writer.release()
                _number_track(temporary)
        # OpenCV does not report pictures that it failed to encode or to write to a full disk.
        written = _pictures_in(temporary)
        if written != len(result.samples):
            raise DataError(f"{path}: only {written} of {len(result.samples)} pictures were written: disk full?")


def check_video_path(path: Path) -> None:
    """Check the path of a video.

    Raises:
        DataError: if it does not end in .webm.
    """
    if path.suffix != ".webm":
        raise DataError(f"{path}: expected a name that ends in .webm")


@contextmanager
def _without_stderr() -> Iterator[None]:
    """Suppress output of C libraries to file descriptor 2."""
    kept, nothing = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nothing, 2)
    try:
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nothing)


def _open(path: Path, picture: ByteArray, rate_hz: float) -> cv2.VideoWriter:
    """Open a VP8 writer for pictures of this size."""
    size = (picture.shape[1], picture.shape[0])
    # OpenCV warns about the codec tag but writes valid VP8.
    with _without_stderr():
        return cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"VP80"), rate_hz, size)


def _number_track(path: Path) -> None:
    """Replace FFmpeg's random track number, so that equal tracks give equal bytes."""
    with path.open("r+b") as file:
        head = file.read(4096)
        _, found, rest = head.partition(b"\x73\xc5\x88")  # TrackUID of eight bytes
        if found:
            file.seek(0)
            file.write(head.replace(rest[:8], b"\0\0\0\0\0\0\0\1"))


def _pictures_in(path: Path) -> int:
    """Return the number of pictures in a video, by reading it."""
    count = 0
    with _without_stderr():
        reader = cv2.VideoCapture(str(path))
        while reader.grab():
            count += 1
        reader.release()
    return count


def _rate_hz(result: SceneTracks) -> float:
    """Return the key frames per second; 1 for a single key frame."""
    steps = np.diff([sample.timestamp_us for sample in result.samples])
    return float(np.clip(1e6 / np.median(steps), 1, 60)) if len(steps) else 1.0


def draw_frame(result: SceneTracks, number: int, frame: Frame, bev: BEVMap) -> ByteArray:
    """Draw key frame `number` as RGB (H, W, 3) with even height and width."""
    tracks, pose = result.tracks[number], result.world_from_ego[number]
    right = draw_bev_panel(bev, tracks, collect_trails(result, number), pose, frame.rig.ego_vehicle)
    if frame.images:
        left = _camera_panels(frame, tracks, pose)
        height = max(right.shape[0], left.shape[0])
        rest = draw_list_panel(tracks, pose, (_CAMERAS_PX, height - left.shape[0]))
        right = np.pad(right, ((0, height - right.shape[0]), (0, 0), (0, 0)))
        right = np.hstack([np.vstack([left, rest]), right])
    return np.ascontiguousarray(right[: right.shape[0] // 2 * 2, : right.shape[1] // 2 * 2])


def collect_trails(result: SceneTracks, number: int) -> dict[int, FloatArray]:
    """Return the world positions (K, 3) of each track of key frame `number` over the last TRAIL_S seconds."""
    now_us = result.samples[number].timestamp_us
    places: dict[int, list[FloatArray]] = {track.id: [] for track in result.tracks[number]}
    for sample, tracks in zip(result.samples[: number + 1], result.tracks[: number + 1], strict=True):
        for track in tracks:
            if track.id in places and now_us - sample.timestamp_us <= TRAIL_S * 1e6:
                places[track.id].append(track.position_world_m)
    return {name: np.stack(path) for name, path in places.items()}


# Camera panels ----------------------------------------------------------------------------------------------------


def _camera_panels(frame: Frame, tracks: tuple[Track, ...], world_from_ego: FloatArray) -> ByteArray:
    """Draw all cameras with an image, in rows of equal width."""
    seeing = frame.rig.select(frame.images)
    rows = camera_rows(seeing)
    width = _CAMERAS_PX // max(len(row) for row in rows)
    height = max(round(width * camera.height_px / camera.width_px) for camera in seeing)
    picture: ByteArray = np.zeros((height * len(rows), _CAMERAS_PX, 3), np.uint8)
    for r, row in enumerate(rows):
        for c, camera in enumerate(row):
            size = (width, round(width * camera.height_px / camera.width_px))
            panel = draw_camera_panel(frame.images[camera.channel], camera, tracks, world_from_ego, size)
            picture[r * height : r * height + size[1], c * width : (c + 1) * width] = panel
    return picture
