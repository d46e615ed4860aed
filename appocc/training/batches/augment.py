"""Data augmentation of samples with their ground truth: ego frame, mirroring, colours, cameras and extrinsics."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.random import Generator
from scipy.spatial.transform import Rotation

from appocc.checks import ByteArray, FloatArray
from appocc.errors import ShapeError
from appocc.geometry import inverse, quaternion_from_yaw, transform
from appocc.grid import BEVGrid
from appocc.training.batches.camera_style import apply_style, apply_tone, draw_style
from appocc.training.batches.packed_objects import mirror_objects, move_objects, repaint_objects
from appocc.training.batches.reading import APPEARANCE_BIT, PackedSample, crop

# Weights of the sRGB channels in grey (Rec. 601).
_GREY = np.array([0.299, 0.587, 0.114])


@dataclass(frozen=True, kw_only=True)
class Augmentation:
    """Ranges of the augmentation, sampled uniformly; 0 switches a transform off.

    Attributes:
        yaw_rad: largest rotation of the ego frame to either side; pi is the full circle.
        shift_m: largest shift of the ego frame along x and along y.
        mirror: share of samples that are mirrored left to right.
        brightness: largest relative change of brightness, at most 1.
        contrast: largest relative change of the distance from middle grey.
        saturation: largest relative change of the distance from the grey of each colour.
        camera_style: share of samples with the look of another camera system (`training.batches.camera_style`).
        cameras_dropped: largest number of dropped cameras; one always remains.
        extrinsic_rad: largest rotation error of each camera, about any axis.
        extrinsic_m: largest translation error of each camera, in any direction.
    """

    yaw_rad: float = 0.0
    shift_m: float = 0.0
    mirror: float = 0.0
    brightness: float = 0.0
    contrast: float = 0.0
    saturation: float = 0.0
    camera_style: float = 0.0
    cameras_dropped: int = 0
    extrinsic_rad: float = 0.0
    extrinsic_m: float = 0.0


def augment(sample: PackedSample, ranges: Augmentation, grid: BEVGrid, rng: Generator) -> PackedSample:
    """Return an augmented copy of a sample on a grid that is part of its own grid, with the same cells.

    Each transform has its own random generator, so that switching one on does not change the others.

    Args:
        sample: packed sample; not modified.
        ranges: ranges of the transforms.
        grid: grid of the returned ground truth. If the grid of the sample is larger, its margin fills the edges of
            rotated samples; cells from outside the sample's grid are unknown.
        rng: new random generator of this sample.
    """
    frames, mirrors, light, drops, poses, styles = rng.spawn(6)
    mirror = bool(mirrors.random() < ranges.mirror)
    new_from_ego = _sample_frame(ranges, frames)
    sample = mirror_sample(sample) if mirror else sample
    sample = reframe(sample, new_from_ego, grid) if new_from_ego is not None else crop(sample, grid)
    if ranges.brightness or ranges.contrast or ranges.saturation:
        sample = jitter_colours(sample, *_sample_colour_jitter(ranges, light))
    if styles.random() < ranges.camera_style:
        sample = _restyle(sample, styles)
    if ranges.cameras_dropped:
        sample = _drop_cameras(sample, ranges.cameras_dropped, drops)
    if ranges.extrinsic_rad or ranges.extrinsic_m:
        sample = _perturb_extrinsics(sample, ranges, poses)
    return sample


# Geometry ---------------------------------------------------------------------------------------------------------


def _sample_frame(ranges: Augmentation, rng: Generator) -> FloatArray | None:
    """Sample a rotation and shift of the ego frame, `new_from_ego`; None if both are switched off."""
    yaw, x, y = rng.uniform(-1, 1, 3) * [ranges.yaw_rad, ranges.shift_m, ranges.shift_m]
    return transform(quaternion_from_yaw(yaw), [x, y, 0.0]) if ranges.yaw_rad or ranges.shift_m else None


def mirror_sample(sample: PackedSample) -> PackedSample:
    """Mirror a sample at the plane y = 0 of the ego frame.

    Images are mirrored left to right. Each pose is reflected twice, y -> -y in the ego frame and x -> -x in the
    camera frame, and therefore remains a rigid transform; the principal point is counted from the other side. Camera
    names are not swapped: networks use the poses only.

    Raises:
        ShapeError: if the grid is not symmetric in y.
    """
    if sample.grid.y_max_m != -sample.grid.y_min_m:
        found = f"{sample.grid.y_min_m:g}..{sample.grid.y_max_m:g}"
        raise ShapeError(f"mirroring: expected a grid symmetric in y, got y {found} m")
    mirror_y, mirror_x = np.diag([1.0, -1, 1, 1]), np.diag([-1.0, 1, 1, 1])
    k = sample.intrinsic.copy()
    k[:, 0, 1] *= -1
    k[:, 0, 2] = sample.images.shape[2] - 1 - k[:, 0, 2]
    return sample._replace(
        images=sample.images[:, :, ::-1],
        intrinsic=k,
        ego_from_cam=mirror_y @ sample.ego_from_cam @ mirror_x,
        occupancy=sample.occupancy[:, ::-1],
        known=sample.known[:, ::-1],
        appearance=sample.appearance[:, :, ::-1],
        depth_m=sample.depth_m[:, :, ::-1],
        kind=sample.kind[:, :, ::-1],
        world_from_ego=mirror_y @ sample.world_from_ego @ mirror_y,
        objects=mirror_objects(sample.objects),
        owner=sample.owner[:, ::-1],
    )


def reframe(sample: PackedSample, new_from_ego: FloatArray, grid: BEVGrid) -> PackedSample:
    """Transform camera poses and ground truth of a sample to an ego frame rotated about z and shifted on the ground.

    Cells are resampled by nearest neighbour, so that classes and colours do not mix; cells outside the sample's grid
    are unknown.

    Args:
        sample: packed sample.
        new_from_ego: (4, 4) transform to the new ego frame.
        grid: grid in the new ego frame.
    """
    ego_from_new = inverse(new_from_ego)
    (along, across), middle = ego_from_new[:2, :2].T, grid.centres()
    # Rows and columns of cells are rotated separately and added: X 1 2 + 1 Y 2.
    points = middle[:, :1, :1] * along + (middle[:1, :, 1:] * across + ego_from_new[:2, 3])
    cell = sample.grid.cell_of(points)
    inside = sample.grid.contains(cell)
    high, wide = sample.grid.shape
    place = np.where(inside, cell[..., 0] * wide + cell[..., 1], 0)
    return sample._replace(
        ego_from_cam=new_from_ego @ sample.ego_from_cam,
        occupancy=np.take(sample.occupancy.ravel(), place) * inside,
        known=np.take(sample.known.ravel(), place) * inside,
        appearance=np.take(sample.appearance.reshape(3, high * wide), place, axis=1) * inside,
        world_from_ego=sample.world_from_ego @ ego_from_new,
        objects=move_objects(sample.objects, new_from_ego),
        owner=np.take(sample.owner.ravel(), place) * inside,
        grid=grid,
    )


# Colours ----------------------------------------------------------------------------------------------------------


def _sample_colour_jitter(ranges: Augmentation, rng: Generator) -> tuple[float, float, float]:
    """Sample factors of brightness, contrast and saturation."""
    brightness, contrast, saturation = rng.uniform(-1, 1, 3)
    return (
        1 + brightness * ranges.brightness,
        1 + contrast * ranges.contrast,
        1 + saturation * ranges.saturation,
    )


def jitter_colours(sample: PackedSample, brightness: float, contrast: float, saturation: float) -> PackedSample:
    """Scale brightness, then contrast about middle grey, then saturation about the grey of each colour.

    Images, map and paint of the objects change alike: the map has the colours of the images, and a network cannot
    infer the jitter.
    """
    # Three affine transforms in a row: colour -> matrix @ colour + offset.
    matrix = saturation * np.eye(3) + (1 - saturation) * np.tile(_GREY, (3, 1))
    offset = np.full(3, (1 - contrast) * 127.5)
    change = np.column_stack([brightness * contrast * matrix, matrix @ offset])
    n, high, wide, _ = sample.images.shape
    images = _apply_colour_matrix(sample.images.reshape(n * high, wide, 3), change).reshape(n, high, wide, 3)
    appearance = _apply_colour_matrix(np.moveaxis(sample.appearance, 0, 2), change)
    known = (sample.known >> APPEARANCE_BIT & 1).astype(bool)
    objects = repaint_objects(sample.objects, lambda rgb: _apply_colour_matrix(rgb, change))
    return sample._replace(images=images, appearance=np.moveaxis(appearance, 2, 0) * known, objects=objects)


def _apply_colour_matrix(rgb: ByteArray, change: FloatArray) -> ByteArray:
    """Apply an affine colour transform (3, 4) to colours (H, W, 3); round and clip to 0..255."""
    return np.asarray(cv2.transform(np.ascontiguousarray(rgb), change), np.uint8)


def _restyle(sample: PackedSample, rng: Generator) -> PackedSample:
    """Draw a camera style for the images; its tone applies to map and paint too, as in `jitter_colours`."""
    style = draw_style(rng)
    known = (sample.known >> APPEARANCE_BIT & 1).astype(bool)
    appearance = np.moveaxis(apply_tone(np.moveaxis(sample.appearance, 0, 2), style), 2, 0)
    objects = repaint_objects(sample.objects, lambda rgb: apply_tone(rgb, style))
    images = apply_style(sample.images, style, rng)
    return sample._replace(images=images, appearance=appearance * known, objects=objects)


# Cameras ----------------------------------------------------------------------------------------------------------


def _drop_cameras(sample: PackedSample, limit: int, rng: Generator) -> PackedSample:
    """Drop 0 to `limit` cameras of a sample; one always remains."""
    living = np.flatnonzero(sample.alive)
    count = min(int(rng.integers(limit + 1)), len(living) - 1)
    alive = sample.alive.copy()
    alive[rng.permutation(living)[: max(count, 0)]] = False
    return sample._replace(alive=alive)


def _perturb_extrinsics(sample: PackedSample, ranges: Augmentation, rng: Generator) -> PackedSample:
    """Add errors of a bad calibration to the camera poses; images and ground truth do not change."""
    n = len(sample.alive)
    directions = rng.normal(size=(2, n, 3))
    steps = directions / np.linalg.norm(directions, axis=-1, keepdims=True) * rng.random((2, n, 1))
    poses = sample.ego_from_cam.copy()
    poses[:, :3, :3] = poses[:, :3, :3] @ Rotation.from_rotvec(steps[0] * ranges.extrinsic_rad).as_matrix()
    poses[:, :3, 3] += steps[1] * ranges.extrinsic_m
    return sample._replace(ego_from_cam=poses)
