"""Recordings of one's own cameras, made from a simulated dataset: folders of images, videos, files of poses."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Sequence
from pathlib import Path

import cv2
import numpy as np

from appocc.checks import ByteArray, FloatArray
from appocc.files import read_image
from appocc.geometry import quaternion_from_rotation
from appocc.nuscenes import Dataset


def write_folders(root: Path, out: Path) -> Path:
    """Write the images of a dataset as CAMERA/TIME.jpg, with times in microseconds; the folder."""
    dataset = Dataset(root)
    for sample in dataset.samples(dataset.scenes[0]):
        for channel, data in dataset.data(sample).items():
            if data.modality == "camera":
                (out / channel).mkdir(parents=True, exist_ok=True)
                shutil.copyfile(dataset.path(data), out / channel / f"{data.timestamp_us}.jpg")
    return out


def write_videos(root: Path, out: Path, fps: float, ending: str = ".avi") -> Path:
    """Write the images of a dataset as CAMERA.avi; the folder."""
    dataset = Dataset(root)
    samples = dataset.samples(dataset.scenes[0])
    out.mkdir(parents=True, exist_ok=True)
    for channel, first in dataset.data(samples[0]).items():
        if first.modality == "camera":
            paths = [dataset.path(dataset.data(sample)[channel]) for sample in samples]
            write_video(out / f"{channel}{ending}", [read_image(path) for path in paths], fps)
    return out


def write_video(path: Path, frames: Sequence[ByteArray], fps: float) -> Path:
    """Write RGB frames as a video."""
    height, width = frames[0].shape[:2]
    code = cv2.VideoWriter.fourcc(
        *("VP80" if path.suffix == ".webm" else "MJPG" if path.suffix == ".avi" else "mp4v")
    )
    writer = cv2.VideoWriter(str(path), code, fps, (width, height))
    assert writer.isOpened()
    for frame in frames:
        writer.write(np.ascontiguousarray(frame[..., ::-1]))
    writer.release()
    return path


def poses_of(root: Path) -> tuple[list[int], list[FloatArray]]:
    """Times in microseconds and world_from_ego of the samples of a dataset."""
    dataset = Dataset(root)
    samples = dataset.samples(dataset.scenes[0])
    return [sample.timestamp_us for sample in samples], [dataset.world_from_ego(sample) for sample in samples]


def write_tum(path: Path, times_us: Sequence[int], poses: Sequence[FloatArray]) -> Path:
    """Write poses as a TUM file."""
    rows = []
    for time_us, pose in zip(times_us, poses, strict=True):
        w, x, y, z = quaternion_from_rotation(pose[:3, :3])
        rows.append([f"{time_us / 1e6:.6f}", *(f"{value:.9f}" for value in (*pose[:3, 3], x, y, z, w))])
    path.write_text("# time x y z qx qy qz qw\n" + "".join(" ".join(row) + "\n" for row in rows))
    return path


def write_cameras(
    out: Path, cameras: Sequence[str], times: Sequence[str], image: Callable[[str, int], ByteArray]
) -> Path:
    """Write an image of each camera at each time as CAMERA/TIME.png; the folder."""
    for camera in cameras:
        (out / camera).mkdir(parents=True, exist_ok=True)
        for number, time in enumerate(times):
            cv2.imwrite(str(out / camera / f"{time}.png"), image(camera, number)[..., ::-1])
    return out
