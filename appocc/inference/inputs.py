"""Moments to predict: the samples of a dataset, or folders of images with a rig; dead cameras are left out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from appocc.camera import Camera, CameraRig
from appocc.checks import ByteArray
from appocc.ego_vehicle import EgoVehicle
from appocc.errors import DataError
from appocc.files import plain_name, read_image
from appocc.frame import Frame
from appocc.nuscenes.dataset import Dataset
from appocc.nuscenes.records import Sample, Scene
from appocc.provenance import Parts, digest, sample_parts, state_of

_ENDINGS = (".jpg", ".jpeg", ".png")
# A picture without anything brighter is that of a dead camera: the darkest night has lamps and noise.
_BLACK = 8


class View(NamedTuple):
    """What the cameras of a moment give.

    Attributes:
        frame: the moment; its images are those of living cameras only.
        dead: reason by channel of the others.
    """

    frame: Frame
    dead: Mapping[str, str]


class Moment(NamedTuple):
    """A moment to predict.

    Attributes:
        token: name of its map.
        title: name of its picture.
        read: its view; read late, so that a long recording need not fit into memory.
        parts: what its map is made from.
    """

    token: str
    title: str
    read: Callable[[], View]
    parts: Callable[[], Parts]


def dataset_moments(dataset: Dataset, scenes: Sequence[Scene]) -> list[Moment]:
    """The key frames of scenes.

    Raises:
        DataError: if there are none.
    """
    moments = []
    for scene in scenes:
        name = plain_name(dataset.root, scene.name)
        for number, sample in enumerate(dataset.samples(scene)):
            read, parts = partial(_read_sample, dataset, sample), partial(sample_parts, dataset, sample)
            moments.append(Moment(plain_name(dataset.root, sample.token), f"{name}-{number:04d}", read, parts))
    if not moments:
        raise DataError(f"{dataset.root}: no key frames")
    return moments


def folder_moments(folder: Path, rig: CameraRig) -> list[Moment]:
    """A folder with one image a camera, each named by its channel, or the sub-folders that have such.

    Raises:
        DataError: if there is no such image.
    """
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
        Moment(name, name, partial(_read_folder, path, rig), partial(_folder_parts, path, rig))
        for name, path in zip(names, found, strict=True)
    ]


def _read_sample(dataset: Dataset, sample: Sample) -> View:
    frame = dataset.frame(sample, images=False)
    files = dataset.data(sample)
    paths = {camera.channel: dataset.path(files[camera.channel]) for camera in frame.rig}
    images, dead = _living(frame.rig, paths)
    return View(Frame(frame.token, frame.timestamp_us, frame.world_from_ego, frame.rig, images), dead)


def _read_folder(folder: Path, rig: CameraRig) -> View:
    images, dead = _living(rig, _images(folder, rig))
    return View(Frame(folder.resolve().name, 0, np.eye(4), rig, images), dead)


def _folder_parts(folder: Path, rig: CameraRig) -> Parts:
    """What the map of a folder of images is made from."""
    cameras = [(c.channel, c.width_px, c.height_px, c.intrinsic.tolist(), c.ego_from_cam.tolist()) for c in rig]
    files = [(channel, path.name, state_of(path)) for channel, path in _images(folder, rig).items()]
    # A vehicle of the default size leaves the digest as it was before rigs had a vehicle.
    vehicle = [] if rig.ego_vehicle == EgoVehicle() else [asdict(rig.ego_vehicle)]
    return {"pictures": digest(files), "calibration": digest([*cameras, *vehicle])}


def _images(folder: Path, rig: CameraRig) -> dict[str, Path]:
    """The image of each channel that has one."""
    found: dict[str, Path] = {}
    for path in sorted(folder.iterdir()):
        if path.suffix.lower() in _ENDINGS and path.stem in rig.channels and path.is_file():
            if path.stem in found:
                raise DataError(
                    f"{folder}: expected one image of {path.stem}, got {found[path.stem].name} and {path.name}"
                )
            found[path.stem] = path
    return found


def _living(rig: CameraRig, paths: Mapping[str, Path]) -> tuple[dict[str, ByteArray], dict[str, str]]:
    """Images of the cameras that work, and why the others do not."""
    images: dict[str, ByteArray] = {}
    dead: dict[str, str] = {}
    for camera in rig:
        if camera.channel not in paths:
            dead[camera.channel] = "no image"
            continue
        try:
            image = read_image(paths[camera.channel])
        except DataError as error:
            dead[camera.channel] = str(error)
            continue
        _check_size(paths[camera.channel], image, camera)
        if int(image.max()) <= _BLACK:
            dead[camera.channel] = f"{paths[camera.channel]}: the image is black"
        else:
            images[camera.channel] = image
    return images, dead


def _check_size(path: Path, image: ByteArray, camera: Camera) -> None:
    """A picture of another size than the rig says is no dead camera: the rig is wrong, and so is every projection."""
    if image.shape[:2] != (camera.height_px, camera.width_px):
        expected, got = f"{camera.width_px}x{camera.height_px}", f"{image.shape[1]}x{image.shape[0]}"
        raise DataError(f"{path}: expected {expected} pixels, as its rig says, got {got}")
