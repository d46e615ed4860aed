"""One sample of a dataset as it is packed: its pictures at the network's size, its cameras and its truth."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from appocc.bevmap import BEVMap, bev_path, load_map
from appocc.camera import Camera
from appocc.checks import BoolArray, ByteArray, FloatArray
from appocc.errors import AppoccError, DataError
from appocc.files import read_image
from appocc.geometry import apply, inverse
from appocc.grid import BEVGrid
from appocc.models.input_images import fitted
from appocc.models.model_spec import Setting
from appocc.nuscenes.dataset import LIDAR, Dataset
from appocc.nuscenes.lidar import read_lidar
from appocc.nuscenes.records import Sample as Moment
from appocc.nuscenes.view_targets import BLOCK_PX, ViewTargets, load_view_targets, view_targets_path

UNKNOWN_KIND = 255
APPEARANCE_BIT = 3

Depths = NDArray[np.float16]


class Sample(NamedTuple):
    """One sample as it is packed; of a dead camera, nothing means anything.

    Attributes:
        images: (N, H, W, 3) uint8 sRGB.
        intrinsic: (N, 3, 3) float64, pixels of these pictures.
        ego_from_cam: (N, 4, 4) float64.
        alive: (N,) bool, which cameras took a picture.
        occupancy: (X, Y) uint8, bit k is set where class k (road, vehicle, lane) is.
        known: (X, Y) uint8, bit k is set where that is known, bit 3 where the appearance is.
        appearance: (3, X, Y) uint8 sRGB.
        depth_m: (N, h, w) float16 at an eighth of the pictures' size, infinite in the sky, 0 where unknown.
        kind: (N, h, w) uint8 `ViewClass`, 255 where unknown.
        grid: of the truth; it may reach farther than the setting's.
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
    grid: BEVGrid
    channels: tuple[str, ...]


ARRAYS = Sample._fields[:-2]


def cropped(sample: Sample, grid: BEVGrid) -> Sample:
    """The sample with the truth of a grid that lies within its own.

    Raises:
        DataError: if their cells do not coincide, or the grid does not lie within.
    """
    x, y = _corner(sample.grid, grid)
    cells = (slice(x, x + grid.shape[0]), slice(y, y + grid.shape[1]))
    return sample._replace(
        occupancy=sample.occupancy[cells],
        known=sample.known[cells],
        appearance=sample.appearance[:, *cells],
        grid=grid,
    )


def _corner(outer: BEVGrid, inner: BEVGrid) -> tuple[int, int]:
    """The cell of one grid at which the other begins.

    Raises:
        DataError: if their cells do not coincide, or the other does not lie within.
    """
    offset = np.array([inner.x_min_m - outer.x_min_m, inner.y_min_m - outer.y_min_m]) / outer.cell_m
    cell = np.rint(offset).astype(int)
    low, high = cell, np.array(outer.shape) - cell - inner.shape
    same = abs(inner.cell_m - outer.cell_m) < 1e-9 and bool((np.abs(offset - cell) < 1e-6).all())
    if not same or min(*low, *high) < 0:
        told = [", ".join(f"{value:g}" for value in grid.as_array()) for grid in (inner, outer)]
        raise DataError(f"expected a map that covers the grid ({told[0]}) cell on cell, got ({told[1]})")
    return int(cell[0]), int(cell[1])


Layout = dict[str, tuple[tuple[int, ...], type[np.generic]]]


def layout(samples: int, cameras: int, setting: Setting, grid: BEVGrid) -> Layout:
    """Shape and type of each array of a pack."""
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
    }


def _view_size(picture: Setting | Camera) -> tuple[int, int]:
    """Rows and columns of depth and kind."""
    return -(-picture.height_px // BLOCK_PX), -(-picture.width_px // BLOCK_PX)


@dataclass(frozen=True)
class Source:
    """Files and cameras of one sample.

    Attributes:
        token: of the sample.
        channels: cameras of the pack.
        views: by channel, the picture's path and the camera in the ego frame at the sample's time.
        lidar: the sweep's path and `ego_from_lidar` at that time, None where it has none.
    """

    token: str
    channels: tuple[str, ...]
    views: Mapping[str, tuple[Path, Camera]]
    lidar: tuple[Path, FloatArray] | None


def source_of(dataset: Dataset, moment: Moment, channels: tuple[str, ...]) -> Source:
    """What a worker needs of a sample.

    Raises:
        DataError: if it has none of these cameras.
    """
    files, rig = dataset.data(moment), dataset.frame(moment, images=False).rig
    views = {name: (dataset.path(files[name]), rig[name]) for name in channels if name in rig.channels}
    if not views:
        found = f"expected one of {', '.join(channels)}, got {', '.join(rig.channels) or 'no camera'}"
        raise DataError(f"{dataset.root}: sample {moment.token}: {found}")
    lidar = files.get(LIDAR)
    if lidar is None:
        return Source(moment.token, channels, views, None)
    ego_from_world = inverse(dataset.world_from_ego(moment))
    ego_from_lidar = ego_from_world @ dataset.world_from_ego_at(lidar) @ dataset.ego_from_sensor(lidar)
    return Source(moment.token, channels, views, (dataset.path(lidar), ego_from_lidar))


def read_sample(wanted: Source, root: Path, source: str, setting: Setting, grid: BEVGrid) -> Sample:
    """Read the files of one sample.

    Raises:
        DataError: if one is missing or damaged.
    """
    parts = layout(1, len(wanted.channels), setting, grid)
    arrays: dict[str, Any] = {name: np.zeros(shape[1:], dtype) for name, (shape, dtype) in parts.items()}
    sample = Sample(**arrays, grid=grid, channels=wanted.channels)
    sample.kind[:] = UNKNOWN_KIND
    sample.intrinsic[:], sample.ego_from_cam[:] = np.eye(3), np.eye(4)
    path = view_targets_path(root, wanted.token)
    views = load_view_targets(path) if path.is_file() else None
    points = None
    if views is None and wanted.lidar is not None:
        points = apply(wanted.lidar[1], read_lidar(wanted.lidar[0])[:, :3])
    for n, channel in enumerate(wanted.channels):
        if channel not in wanted.views:
            continue
        image_path, camera = wanted.views[channel]
        image = read_image(image_path, (camera.width_px, camera.height_px))
        sample.images[n], own = fitted(image, camera, setting)
        sample.alive[n], sample.intrinsic[n], sample.ego_from_cam[n] = True, own.intrinsic, own.ego_from_cam
        if views is not None and channel in views:
            sample.depth_m[n], sample.kind[n] = _view_targets(views[channel], camera, own)
        elif points is not None:
            sample.depth_m[n] = _nearest_depths(points, own)
    bev = load_map(root, source, wanted.token)
    _check_grid(bev, grid, setting, bev_path(root, source, wanted.token))
    bits = np.array([1, 2, 4], np.uint8)[:, None, None]
    sample.occupancy[:] = ((bev.occupancy >= 0.5) * bits).sum(axis=0)
    sample.known[:] = (bev.occupancy_valid * bits).sum(axis=0) + (bev.appearance_valid << APPEARANCE_BIT)
    sample.appearance[:] = bev.appearance
    return sample


def _check_grid(bev: BEVMap, grid: BEVGrid, setting: Setting, path: Path) -> None:
    """Check that a map has the grid of the pack's first, and covers the setting's."""
    if bev.grid != grid:
        raise DataError(f"{path}: expected the grid of the first map, {grid}, got {bev.grid}")
    try:
        _corner(grid, setting.grid)
    except AppoccError as error:
        raise DataError(f"{path}: {error}") from error


def _view_targets(targets: ViewTargets, taken: Camera, own: Camera) -> tuple[Depths, ByteArray]:
    """Depth and kind of each block of 8x8 pixels of the fitted picture.

    Each is that of the block of the taken picture at its centre; blocks that it does not have are unknown.
    """
    rows, columns = _view_size(own)
    scale = taken.intrinsic[[0, 1], [0, 1]] / own.intrinsic[[0, 1], [0, 1]]
    shift = taken.intrinsic[:2, 2] - scale * own.intrinsic[:2, 2]
    middle = (BLOCK_PX - 1) / 2
    i = np.floor(((np.arange(rows) * BLOCK_PX + middle) * scale[1] + shift[1] + 0.5) / BLOCK_PX + 1e-9).astype(int)
    j = np.floor(((np.arange(columns) * BLOCK_PX + middle) * scale[0] + shift[0] + 0.5) / BLOCK_PX + 1e-9).astype(int)
    high, wide = targets.kind.shape
    inside = ((i >= 0) & (i < high))[:, None] & ((j >= 0) & (j < wide))
    block = np.ix_(i.clip(0, high - 1), j.clip(0, wide - 1))
    with np.errstate(over="ignore"):
        depth = np.where(inside, targets.depth_m[block], 0).astype(np.float16)
    return depth, np.where(inside, targets.kind[block], np.uint8(UNKNOWN_KIND))


def _nearest_depths(points_ego: FloatArray, camera: Camera) -> Depths:
    """The nearest depth of points (N, 3) in each block of 8x8 pixels, 0 where there is none."""
    rows, columns = _view_size(camera)
    uv, depth = camera.project_ego(points_ego)
    seen = camera.sees(uv, depth)
    block = np.floor((uv[seen] + 0.5) / BLOCK_PX).astype(np.int64)
    nearest = np.full(rows * columns, np.inf)
    np.minimum.at(nearest, block[:, 1] * columns + block[:, 0], depth[seen])
    return np.where(np.isinf(nearest), 0, nearest).reshape(rows, columns).astype(np.float16)
