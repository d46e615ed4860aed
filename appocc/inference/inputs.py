"""Inference inputs: key frames of a dataset, or folders of images with a rig; missing cameras are left out."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, replace
from functools import lru_cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from appocc.camera import Camera
from appocc.checks import ByteArray, FloatArray
from appocc.ego_vehicle import EgoVehicle
from appocc.errors import DataError
from appocc.files import check_folder, path_of, plain_name, read_images
from appocc.files.questions import can_list, state_of
from appocc.frame import Frame
from appocc.geometry import apply
from appocc.levelling import ego_from_level, is_level, lowest_points
from appocc.nuscenes.dataset import LIDAR, Dataset
from appocc.nuscenes.records import Sample, SampleData, Scene
from appocc.provenance import Parts, digest, sample_parts
from appocc.rigs import SourceRig
from appocc.typing import PathLike

_ENDINGS = (".jpg", ".jpeg", ".png")
# An image without a brighter pixel is from a camera that does not work: the darkest night has lamps and noise.
_BLACK = 8


class LoadedFrame(NamedTuple):
    """A frame with the images of all working cameras.

    Attributes:
        frame: key frame; it has no images of missing cameras.
        missing: channel, or name of source camera -> reason, for the missing cameras.
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
        titles = dataset.titles(scene)
        for sample in dataset.samples(scene):
            read = partial(_read_sample, dataset, sample, level)
            parts = partial(sample_parts, dataset, sample, level)
            token, title = plain_name(dataset.root, sample.token), titles[sample.token]
            pose = partial(dataset.world_from_ego, sample)
            inputs.append(InferenceInput(token, title, read, parts, pose, scene.name))
    if not inputs:
        raise DataError(f"{dataset.root}: no key frames")
    return inputs


def folder_inputs(
    folder: PathLike, rig: SourceRig, tell: Callable[[str], object] = lambda line: None
) -> list[InferenceInput]:
    """Return a folder that holds a picture named by camera for each, or its sub-folders that hold such pictures.

    Args:
        folder: the folder.
        rig: source cameras of the pictures, which are rectified.
        tell: called once for each line to tell: which pictures are scaled to the size of their camera.

    Raises:
        DataError: if there is no such picture.
    """
    folder = path_of(folder)
    check_folder(folder)
    folders = [folder, *sorted(path for path in folder.iterdir() if path.is_dir())]
    found = [path for path in folders if _images(path, rig)]
    if folder in found:
        found = [folder]
    if not found:
        wanted = ", ".join(f"{name}.jpg" for name in rig.names[:3])
        hint = "convert videos, and folders of a camera each, with: appocc convert images"
        if any((path / "sample_data.json").is_file() for path in folders):
            hint = "a dataset has its own rig: leave out --rig"
        expected = f"images named by the cameras of the rig ({wanted}, ...), here or in a folder for each frame"
        raise DataError(f"{folder}: expected {expected}, got none; {hint}")
    names = [path.resolve().name for path in found]
    once = lru_cache(maxsize=None)(tell)
    return [
        InferenceInput(name, name, partial(_read_folder, path, rig, once), partial(_folder_parts, path, rig))
        for name, path in zip(names, found, strict=True)
    ]


def _read_sample(dataset: Dataset, sample: Sample, level: bool) -> LoadedFrame:
    frame = dataset.frame(sample, images=False)
    files = dataset.data(sample)
    paths = {camera.channel: dataset.path(files[camera.channel]) for camera in frame.rig}
    images, missing = _read_images(paths, frame.rig.channels)
    for camera in frame.rig.select(images):
        _check_size(paths[camera.channel], images[camera.channel], camera)
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


def _read_folder(folder: Path, rig: SourceRig, tell: Callable[[str], object]) -> LoadedFrame:
    """Read the pictures of a folder and rectify them.

    Raises:
        DataError: if a picture has another aspect than its camera.
    """
    paths = _images(folder, rig)
    pictures, missing = _read_images(paths, rig.names)
    for name, picture in pictures.items():
        height, width = picture.shape[:2]
        try:
            line = rig.scaling(name, width, height)
        except DataError as error:
            raise DataError(f"{paths[name]}: {error}") from error
        if line is not None:
            tell(line)
    return LoadedFrame(Frame(folder.resolve().name, 0, np.eye(4), rig.rig, rig.rectify(pictures)), missing)


def _folder_parts(folder: Path, rig: SourceRig) -> Parts:
    """Return digests of the inputs of the map of a folder of images."""
    cameras: list[Any] = [
        (c.channel, c.width_px, c.height_px, c.intrinsic.tolist(), c.ego_from_cam.tolist()) for c in rig.rig
    ]
    files = [(name, path.name, state_of(path)) for name, path in _images(folder, rig).items()]
    # Pinholes and a vehicle of the default size leave the digest as it was before rigs had anything else.
    lenses = [] if rig.is_pinhole else [rig.as_json()]
    vehicle = [] if rig.ego_vehicle == EgoVehicle() else [asdict(rig.ego_vehicle)]
    return {"pictures": digest(files), "calibration": digest([*cameras, *lenses, *vehicle])}


def holds_images(folder: Path) -> bool:
    """Return whether a folder has images, or the first folder in it."""
    if not folder.is_dir() or not can_list(folder):
        return False
    inner = sorted(path for path in folder.iterdir() if path.is_dir())[:1]
    return any(path.suffix.lower() in _ENDINGS for place in (folder, *inner) for path in place.iterdir())


def _images(folder: Path, rig: SourceRig) -> dict[str, Path]:
    """Return the image paths of a folder by name of camera.

    Raises:
        DataError: if a camera has several images.
    """
    found: dict[str, Path] = {}
    for path in sorted(folder.iterdir()):
        if path.suffix.lower() in _ENDINGS and path.stem in rig.names and path.is_file():
            if path.stem in found:
                raise DataError(
                    f"{folder}: expected one image of {path.stem}, got {found[path.stem].name} and {path.name}"
                )
            found[path.stem] = path
    return found


def _read_images(paths: Mapping[str, Path], names: Iterable[str]) -> tuple[dict[str, ByteArray], dict[str, str]]:
    """Read the images of the cameras that work; also return the reason for each that does not, by name."""
    images: dict[str, ByteArray] = {}
    missing: dict[str, str] = {}
    wanted = list(names)
    found = read_images([paths[name] for name in wanted if name in paths])
    for name in wanted:
        if name not in paths:
            missing[name] = "no image"
        elif isinstance(image := next(found), DataError):
            missing[name] = str(image)
        elif int(image.max()) <= _BLACK:
            missing[name] = f"{paths[name]}: the image is black"
        else:
            images[name] = image
    return images, missing


def _check_size(path: Path, image: ByteArray, camera: Camera) -> None:
    """Check the size of an image against the rig: if they differ, the rig and every projection are wrong.

    Raises:
        DataError: if they differ.
    """
    if image.shape[:2] != (camera.height_px, camera.width_px):
        expected, got = f"{camera.width_px}x{camera.height_px}", f"{image.shape[1]}x{image.shape[0]}"
        raise DataError(f"{path}: expected {expected} pixels, as its rig says, got {got}")
