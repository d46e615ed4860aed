"""Inference inputs: key frames of a dataset, or folders of images with a rig; missing cameras are left out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from appocc.camera import Camera, CameraRig
from appocc.checks import ByteArray, FloatArray
from appocc.ego_vehicle import EgoVehicle
from appocc.errors import DataError
from appocc.files import plain_name, read_image
from appocc.frame import Frame
from appocc.geometry import apply
from appocc.levelling import ego_from_level, is_level, lowest_points
from appocc.nuscenes.dataset import LIDAR, Dataset
from appocc.nuscenes.records import Sample, SampleData, Scene
from appocc.provenance import Parts, digest, sample_parts, state_of
from appocc.typing import PathLike

_ENDINGS = (".jpg", ".jpeg", ".png")
# An image without a brighter pixel is from a camera that does not work: the darkest night has lamps and noise.
_BLACK = 8


class LoadedFrame(NamedTuple):
    """A frame with the images of all working cameras.

    Attributes:
        frame: key frame; it has no images of missing cameras.
        missing: channel -> reason, for the missing cameras.
    """

    frame: Frame
    missing: Mapping[str, str]


class InferenceInput(NamedTuple):
    """A key frame to predict, not read yet.

    Attributes:
        token: file name of its map, without the ending.
        title: file name of its picture, without the ending.
        read: reads the frame; called late, because a long recording does not fit into memory.
        parts: digests of the inputs of the map, by name.
        pose: returns the (4, 4) pose world_from_ego; None for images without poses.
        drive: drive that the frame belongs to; its frames follow each other in the order of time. '' for one alone.
    """

    token: str
    title: str
    read: Callable[[], LoadedFrame]
    parts: Callable[[], Parts]
    pose: Callable[[], FloatArray] | None = None
    drive: str = ""


def dataset_inputs(dataset: Dataset, scenes: Sequence[Scene], level: bool = True) -> list[InferenceInput]:
    """Return the key frames of scenes.

    Args:
        dataset: dataset in the nuScenes schema.
        scenes: scenes of the dataset.
        level: whether the frames are levelled with the ground in the LiDAR sweep, where a sample has one.

    Raises:
        DataError: if there are none.
    """
    inputs = []
    for scene in scenes:
        name = plain_name(dataset.root, scene.name)
        for number, sample in enumerate(dataset.samples(scene)):
            read = partial(_read_sample, dataset, sample, level)
            parts = partial(sample_parts, dataset, sample, level)
            token, title = plain_name(dataset.root, sample.token), f"{name}-{number:04d}"
            inputs.append(InferenceInput(token, title, read, parts, partial(dataset.world_from_ego, sample), name))
    if not inputs:
        raise DataError(f"{dataset.root}: no key frames")
    return inputs


def folder_inputs(folder: PathLike, rig: CameraRig) -> list[InferenceInput]:
    """Return a folder that holds an image named by channel for each camera, or its sub-folders that hold such images.

    Raises:
        DataError: if there is no such image.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise DataError(f"{folder}: no such folder")
    folders = [folder, *sorted(path for path in folder.iterdir() if path.is_dir())]
    found = [path for path in folders if _images(path, rig)]
    if folder in found:
        found = [folder]
    if not found:
        wanted = ", ".join(f"{channel}.jpg" for channel in rig.channels[:3])
        raise DataError(f"{folder}: expected images named by the cameras of the rig ({wanted}, ...), got none")
    names = [path.resolve().name for path in found]
    return [
        InferenceInput(name, name, partial(_read_folder, path, rig), partial(_folder_parts, path, rig))
        for name, path in zip(names, found, strict=True)
    ]


def _read_sample(dataset: Dataset, sample: Sample, level: bool) -> LoadedFrame:
    frame = dataset.frame(sample, images=False)
    files = dataset.data(sample)
    paths = {camera.channel: dataset.path(files[camera.channel]) for camera in frame.rig}
    images, missing = _read_images(frame.rig, paths)
    pose = _ego_from_level(dataset, files[LIDAR], frame.world_from_ego) if level and LIDAR in files else None
    return LoadedFrame(replace(frame, images=images, boxes_ego=None, ego_from_level=pose), missing)


def _ego_from_level(dataset: Dataset, sweep: SampleData, world_from_ego: FloatArray) -> FloatArray | None:
    """Return the pose of the level frame on the ground that a LiDAR sees; None if it is the ego frame, or unknown.

    Recordings without the files of their LiDAR are usual.

    Raises:
        DataError: if the file is damaged.
    """
    if not dataset.path(sweep).is_file():
        return None
    ego_from_lidar = dataset.ego_motion(world_from_ego, sweep) @ dataset.ego_from_sensor(sweep)
    pose = ego_from_level(lowest_points(apply(ego_from_lidar, dataset.lidar(sweep)[:, :3])))
    return None if pose is None or is_level(pose) else pose


def _read_folder(folder: Path, rig: CameraRig) -> LoadedFrame:
    images, missing = _read_images(rig, _images(folder, rig))
    return LoadedFrame(Frame(folder.resolve().name, 0, np.eye(4), rig, images), missing)


def _folder_parts(folder: Path, rig: CameraRig) -> Parts:
    """Return digests of the inputs of the map of a folder of images."""
    cameras = [(c.channel, c.width_px, c.height_px, c.intrinsic.tolist(), c.ego_from_cam.tolist()) for c in rig]
    files = [(channel, path.name, state_of(path)) for channel, path in _images(folder, rig).items()]
    # A vehicle of the default size leaves the digest as it was before rigs had a vehicle.
    vehicle = [] if rig.ego_vehicle == EgoVehicle() else [asdict(rig.ego_vehicle)]
    return {"pictures": digest(files), "calibration": digest([*cameras, *vehicle])}


def _images(folder: Path, rig: CameraRig) -> dict[str, Path]:
    """Return the image paths of a folder by channel.

    Raises:
        DataError: if a channel has several images.
    """
    found: dict[str, Path] = {}
    for path in sorted(folder.iterdir()):
        if path.suffix.lower() in _ENDINGS and path.stem in rig.channels and path.is_file():
            if path.stem in found:
                raise DataError(
                    f"{folder}: expected one image of {path.stem}, got {found[path.stem].name} and {path.name}"
                )
            found[path.stem] = path
    return found


def _read_images(rig: CameraRig, paths: Mapping[str, Path]) -> tuple[dict[str, ByteArray], dict[str, str]]:
    """Read the images of the cameras that work; also return the reason for each that does not, by channel."""
    images: dict[str, ByteArray] = {}
    missing: dict[str, str] = {}
    for camera in rig:
        if camera.channel not in paths:
            missing[camera.channel] = "no image"
            continue
        try:
            image = read_image(paths[camera.channel])
        except DataError as error:
            missing[camera.channel] = str(error)
            continue
        _check_size(paths[camera.channel], image, camera)
        if int(image.max()) <= _BLACK:
            missing[camera.channel] = f"{paths[camera.channel]}: the image is black"
        else:
            images[camera.channel] = image
    return images, missing


def _check_size(path: Path, image: ByteArray, camera: Camera) -> None:
    """Check the size of an image against the rig: if they differ, the rig and every projection are wrong.

    Raises:
        DataError: if they differ.
    """
    if image.shape[:2] != (camera.height_px, camera.width_px):
        expected, got = f"{camera.width_px}x{camera.height_px}", f"{image.shape[1]}x{image.shape[0]}"
        raise DataError(f"{path}: expected {expected} pixels, as its rig says, got {got}")
