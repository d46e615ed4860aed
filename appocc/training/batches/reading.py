"""Reading of samples for packing: images at the network's input size, cameras and ground truth."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from appocc.bevmap import BEVMap, bev_path, load_map
from appocc.boxes import Boxes
from appocc.camera import Camera
from appocc.checks import BoolArray, ByteArray, Float32Array, FloatArray, IntArray
from appocc.errors import AppoccError, DataError
from appocc.files import read_image
from appocc.geometry import apply
from appocc.grid import BEVGrid
from appocc.models.input_images import fit_image
from appocc.models.model_spec import ModelSpec
from appocc.nuscenes.dataset import LIDAR, Dataset
from appocc.nuscenes.lidar import read_lidar
from appocc.nuscenes.records import Sample
from appocc.nuscenes.view_targets import BLOCK_PX, UNKNOWN_KIND, ViewTargets, load_view_targets, view_targets_path
from appocc.training.batches.packed_objects import COLUMNS, MAX_OBJECTS, pack_objects

APPEARANCE_BIT = 3

Depths = NDArray[np.float16]


class PackedSample(NamedTuple):
    """A packed sample; fields of missing cameras are undefined.

    Attributes:
        images: (N, H, W, 3) uint8 sRGB.
        intrinsic: (N, 3, 3) float64 intrinsics of the packed images.
        ego_from_cam: (N, 4, 4) float64 camera poses.
        alive: (N,) bool, cameras that have an image.
        occupancy: (X, Y) uint8, bit k: cell is occupied by class k (road, vehicle, lane).
        known: (X, Y) uint8, bit k: class k is known; bit 3: appearance is known.
        appearance: (3, X, Y) uint8 sRGB.
        depth_m: (N, h, w) float16 depth at 1/8 of the image size; infinite in the sky, 0 where unknown.
        kind: (N, h, w) uint8 `ViewClass`, 255 where unknown.
        world_from_ego: (4, 4) float64 ego pose.
        time_us: () int64 timestamp, microseconds.
        objects: (MAX_OBJECTS, 13) float32 annotated objects in the ego frame: kind (index into `KINDS`), centre x, y,
            z, width, length, height, yaw, velocity x, y (NaN if unknown), paint as sRGB 0..255 (NaN if unknown);
            rows of NaN after the last object.
        owner: (X, Y) uint8, 1 + index of the vehicle that covers the cell, 0 for none.
        grid: grid of the ground truth; may be larger than the grid of the setting.
        channels: names of the N cameras.
    """

    images: ByteArray
    intrinsic: FloatArray
    ego_from_cam: FloatArray
    alive: BoolArray
    occupancy: ByteArray
    known: ByteArray
    appearance: ByteArray
    depth_m: Depths
    kind: ByteArray
    world_from_ego: FloatArray
    time_us: IntArray
    objects: Float32Array
    owner: ByteArray
    grid: BEVGrid
    channels: tuple[str, ...]


ARRAYS = PackedSample._fields[:-2]


def crop(sample: PackedSample, grid: BEVGrid) -> PackedSample:
    """Crop the ground truth of a sample to a grid inside its own.

    Raises:
        DataError: if the cells do not coincide, or the grid is not inside.
    """
    x, y = _first_cell(sample.grid, grid)
    cells = (slice(x, x + grid.shape[0]), slice(y, y + grid.shape[1]))
    return sample._replace(
        occupancy=sample.occupancy[cells],
        known=sample.known[cells],
        appearance=sample.appearance[:, *cells],
        owner=sample.owner[cells],
        grid=grid,
    )


def _first_cell(outer: BEVGrid, inner: BEVGrid) -> tuple[int, int]:
    """Return the cell of the outer grid that is the first cell of the inner grid.

    Raises:
        DataError: if the cells do not coincide, or the inner grid is not inside.
    """
    offset = np.array([inner.x_min_m - outer.x_min_m, inner.y_min_m - outer.y_min_m]) / outer.cell_m
    cell = np.rint(offset).astype(int)
    low, high = cell, np.array(outer.shape) - cell - inner.shape
    same = abs(inner.cell_m - outer.cell_m) < 1e-9 and bool((np.abs(offset - cell) < 1e-6).all())
    if not same or min(*low, *high) < 0:
        shown = [", ".join(f"{value:g}" for value in grid.as_array()) for grid in (inner, outer)]
        raise DataError(f"expected a map that covers the grid ({shown[0]}) with the same cells, got ({shown[1]})")
    return int(cell[0]), int(cell[1])


ArrayLayout = dict[str, tuple[tuple[int, ...], type[np.generic]]]


def array_layout(samples: int, cameras: int, setting: ModelSpec, grid: BEVGrid) -> ArrayLayout:
    """Return shape and type of each array of a packed dataset."""
    s, n, (x, y) = samples, cameras, grid.shape
    h, w = _view_size(setting)
    return {
        "images": ((s, n, setting.height_px, setting.width_px, 3), np.uint8),
        "intrinsic": ((s, n, 3, 3), np.float64),
        "ego_from_cam": ((s, n, 4, 4), np.float64),
        "alive": ((s, n), np.bool_),
        "occupancy": ((s, x, y), np.uint8),
        "known": ((s, x, y), np.uint8),
        "appearance": ((s, 3, x, y), np.uint8),
        "depth_m": ((s, n, h, w), np.float16),
        "kind": ((s, n, h, w), np.uint8),
        "world_from_ego": ((s, 4, 4), np.float64),
        "time_us": ((s,), np.int64),
        "objects": ((s, MAX_OBJECTS, COLUMNS), np.float32),
        "owner": ((s, x, y), np.uint8),
    }


def _view_size(image: ModelSpec | Camera) -> tuple[int, int]:
    """Return rows and columns of depth and class targets."""
    return -(-image.height_px // BLOCK_PX), -(-image.width_px // BLOCK_PX)


@dataclass(frozen=True, eq=False, kw_only=True)
class SampleFiles:
    """Files and cameras of one sample.

    Attributes:
        token: sample token.
        channels: cameras of the packed dataset.
        images: by channel, path of the image and camera in the ego frame at the time of the sample.
        lidar: path of the LiDAR sweep and `ego_from_lidar` at that time; None without LiDAR.
        world_from_ego: (4, 4) ego pose.
        time_us: timestamp, microseconds.
        boxes_ego: annotated boxes in the ego frame; None if the scene is not annotated.
    """

    token: str
    channels: tuple[str, ...]
    images: Mapping[str, tuple[Path, Camera]]
    lidar: tuple[Path, FloatArray] | None
    world_from_ego: FloatArray
    time_us: int
    boxes_ego: Boxes | None


def sample_files(dataset: Dataset, sample: Sample, channels: tuple[str, ...]) -> SampleFiles:
    """Return the files and cameras of a sample, for a worker process.

    Raises:
        DataError: if the sample has none of these cameras.
    """
    files, frame = dataset.data(sample), dataset.frame(sample, images=False)
    rig = frame.rig
    images = {name: (dataset.path(files[name]), rig[name]) for name in channels if name in rig.channels}
    if not images:
        found = f"expected one of {', '.join(channels)}, got {', '.join(rig.channels) or 'no camera'}"
        raise DataError(f"{dataset.root}: sample {sample.token}: {found}")
    lidar, sweep = files.get(LIDAR), None
    if lidar is not None:
        ego_from_lidar = dataset.ego_motion(frame.world_from_ego, lidar) @ dataset.ego_from_sensor(lidar)
        sweep = dataset.path(lidar), ego_from_lidar
    return SampleFiles(
        token=sample.token,
        channels=channels,
        images=images,
        lidar=sweep,
        world_from_ego=frame.world_from_ego,
        time_us=frame.timestamp_us,
        boxes_ego=frame.boxes_ego,
    )


def read_sample(files: SampleFiles, root: Path, source: str, setting: ModelSpec, grid: BEVGrid) -> PackedSample:
    """Read one sample from its files.

    Raises:
        DataError: if a file is missing or damaged.
    """
    parts = array_layout(1, len(files.channels), setting, grid)
    arrays: dict[str, Any] = {name: np.zeros(shape[1:], dtype) for name, (shape, dtype) in parts.items()}
    sample = PackedSample(**arrays, grid=grid, channels=files.channels)
    sample.kind[:] = UNKNOWN_KIND
    sample.intrinsic[:], sample.ego_from_cam[:] = np.eye(3), np.eye(4)
    path = view_targets_path(root, files.token)
    targets = load_view_targets(path) if path.is_file() else {}
    points = None
    if files.lidar is not None and all(view.depth_m is None for view in targets.values()):
        points = apply(files.lidar[1], read_lidar(files.lidar[0])[:, :3])
    for n, channel in enumerate(files.channels):
        if channel not in files.images:
            continue
        image_path, camera = files.images[channel]
        image = read_image(image_path, (camera.width_px, camera.height_px))
        sample.images[n], own = fit_image(image, camera, setting)
        sample.alive[n], sample.intrinsic[n], sample.ego_from_cam[n] = True, own.intrinsic, own.ego_from_cam
        if channel in targets:
            sample.depth_m[n], sample.kind[n] = _fit_view_targets(targets[channel], camera, own)
        if points is not None:
            sample.depth_m[n] = _nearest_depths(points, own)
    bev = load_map(root, source, files.token)
    _check_grid(bev, grid, setting, bev_path(root, source, files.token))
    bits = np.array([1, 2, 4], np.uint8)[:, None, None]
    sample.occupancy[:] = ((bev.occupancy >= 0.5) * bits).sum(axis=0)
    sample.known[:] = (bev.occupancy_valid * bits).sum(axis=0) + (bev.appearance_valid << APPEARANCE_BIT)
    sample.appearance[:] = bev.appearance
    sample.world_from_ego[:], sample.time_us[...] = files.world_from_ego, files.time_us
    sample.objects[:] = np.nan
    if files.boxes_ego is not None:
        objects, owner = pack_objects(files.boxes_ego, bev)
        sample.objects[: len(objects)], sample.owner[:] = objects, owner
    return sample


def _check_grid(bev: BEVMap, grid: BEVGrid, setting: ModelSpec, path: Path) -> None:
    """Check that a map has the grid of the first map, and covers the grid of the setting."""
    if bev.grid != grid:
        raise DataError(f"{path}: expected the grid of the first map, {grid}, got {bev.grid}")
    try:
        _first_cell(grid, setting.grid)
    except AppoccError as error:
        raise DataError(f"{path}: {error}") from error


def _fit_view_targets(targets: ViewTargets, original: Camera, fitted_camera: Camera) -> tuple[Depths, ByteArray]:
    """Return depth and class of each block of 8 x 8 pixels of the fitted image.

    A block takes the targets of the original image at its centre; blocks outside the original image, and depths that
    the targets lack, are unknown.
    """
    rows, columns = _view_size(fitted_camera)
    scale = original.intrinsic[[0, 1], [0, 1]] / fitted_camera.intrinsic[[0, 1], [0, 1]]
    shift = original.intrinsic[:2, 2] - scale * fitted_camera.intrinsic[:2, 2]
    middle = (BLOCK_PX - 1) / 2
    i = np.floor(((np.arange(rows) * BLOCK_PX + middle) * scale[1] + shift[1] + 0.5) / BLOCK_PX + 1e-9).astype(int)
    j = np.floor(((np.arange(columns) * BLOCK_PX + middle) * scale[0] + shift[0] + 0.5) / BLOCK_PX + 1e-9).astype(int)
    high, wide = targets.kind.shape
    inside = ((i >= 0) & (i < high))[:, None] & ((j >= 0) & (j < wide))
    block = np.ix_(i.clip(0, high - 1), j.clip(0, wide - 1))
    with np.errstate(over="ignore"):
        known = np.zeros(inside.shape) if targets.depth_m is None else targets.depth_m[block]
        depth = np.where(inside, known, 0).astype(np.float16)
    return depth, np.where(inside, targets.kind[block], np.uint8(UNKNOWN_KIND))


def _nearest_depths(points_ego: FloatArray, camera: Camera) -> Depths:
    """Return the depth of the nearest point (N, 3) in each block of 8 x 8 pixels, 0 in blocks without points."""
    rows, columns = _view_size(camera)
    uv, depth = camera.project_ego(points_ego)
    seen = camera.sees(uv, depth)
    block = np.floor((uv[seen] + 0.5) / BLOCK_PX).astype(np.int64)
    nearest = np.full(rows * columns, np.inf)
    np.minimum.at(nearest, block[:, 1] * columns + block[:, 0], depth[seen])
    return np.where(np.isinf(nearest), 0, nearest).reshape(rows, columns).astype(np.float16)
