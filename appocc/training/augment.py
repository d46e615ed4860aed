"""Changes of training samples that leave them true: another ego frame, mirrored, other light, fewer cameras."""

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
from appocc.training.reading import APPEARANCE_BIT, Sample, cropped

# Shares of the channels in grey (Rec. 601), of sRGB as it is.
_GREY = np.array([0.299, 0.587, 0.114])


@dataclass(frozen=True)
class Augmentation:
    """How far samples are changed; all 0 leaves them as they are. Everything is drawn evenly within its range.

    Attributes:
        yaw_rad: the ego frame is turned by up to so much to either side; pi is the full circle.
        shift_m: and moved by up to so much along x and along y.
        mirror: share of samples that are mirrored left to right.
        brightness: colours are made lighter or darker by up to this share; at most 1.
        contrast: and drawn from or to middle grey.
        saturation: and from or to their own grey.
        cameras_dropped: up to so many cameras are dead; one always stays.
        extrinsic_rad: each camera is believed to be turned by up to so much, about any axis.
        extrinsic_m: and to stand up to so far from where it stands.
    """

    yaw_rad: float = 0.0
    shift_m: float = 0.0
    mirror: float = 0.0
    brightness: float = 0.0
    contrast: float = 0.0
    saturation: float = 0.0
    cameras_dropped: int = 0
    extrinsic_rad: float = 0.0
    extrinsic_m: float = 0.0


def augmented(sample: Sample, strength: Augmentation, grid: BEVGrid, rng: Generator) -> Sample:
    """A changed sample on a grid that lies within its own, cell on cell.

    Each change draws from a generator of its own, so that switching one on leaves the others as they were.

    Args:
        sample: as packed; it is not written to.
        strength: how far it is changed.
        grid: of the truth that is returned. Where a pack's own grid reaches farther, turned samples keep their truth
            at the edges; elsewhere cells that come from outside are unknown.
        rng: fresh generator of this sample.
    """
    frames, mirrors, light, drops, poses = rng.spawn(5)
    mirror = bool(mirrors.random() < strength.mirror)
    new_from_ego = _drawn_frame(strength, frames)
    sample = mirrored(sample) if mirror else sample
    sample = reframed(sample, new_from_ego, grid) if new_from_ego is not None else cropped(sample, grid)
    if strength.brightness or strength.contrast or strength.saturation:
        sample = relit(sample, *_drawn_light(strength, light))
    if strength.cameras_dropped:
        sample = _fewer_cameras(sample, strength.cameras_dropped, drops)
    if strength.extrinsic_rad or strength.extrinsic_m:
        sample = _displaced(sample, strength, poses)
    return sample


# Geometry ---------------------------------------------------------------------------------------------------------


def _drawn_frame(strength: Augmentation, rng: Generator) -> FloatArray | None:
    """A turn and shift of the ego frame, `new_from_ego`; None where there is none."""
    yaw, x, y = rng.uniform(-1, 1, 3) * [strength.yaw_rad, strength.shift_m, strength.shift_m]
    return transform(quaternion_from_yaw(yaw), [x, y, 0.0]) if strength.yaw_rad or strength.shift_m else None


def mirrored(sample: Sample) -> Sample:
    """The sample of a world mirrored at the plane y = 0 of the ego frame.

    The pictures are mirrored left to right, and each pose by y -> -y in the ego frame and x -> -x in the camera's:
    two reflections, so that it stays a rigid transform; K's principal column is counted from the other side. Which
    camera is called left no longer fits; networks know cameras by their poses only.

    Raises:
        ShapeError: if the sample's grid does not reach as far to the left as to the right.
    """
    if sample.grid.y_max_m != -sample.grid.y_min_m:
        found = f"{sample.grid.y_min_m:g}..{sample.grid.y_max_m:g}"
        raise ShapeError(f"mirroring: expected a grid that reaches as far left as right, got y {found} m")
    ego, own = np.diag([1.0, -1, 1, 1]), np.diag([-1.0, 1, 1, 1])
    k = sample.intrinsic.copy()
    k[:, 0, 1] *= -1
    k[:, 0, 2] = sample.images.shape[2] - 1 - k[:, 0, 2]
    return sample._replace(
        images=sample.images[:, :, ::-1],
        intrinsic=k,
        ego_from_cam=ego @ sample.ego_from_cam @ own,
        occupancy=sample.occupancy[:, ::-1],
        known=sample.known[:, ::-1],
        appearance=sample.appearance[:, :, ::-1],
        depth_m=sample.depth_m[:, :, ::-1],
        kind=sample.kind[:, :, ::-1],
    )


def reframed(sample: Sample, new_from_ego: FloatArray, grid: BEVGrid) -> Sample:
    """The sample in another ego frame, turned about z and moved on the ground: poses follow, and so does the truth.

    A cell takes what lies at its centre (nearest: classes and colours of neighbours are not mixed); what lies outside
    the sample's grid is unknown.

    Args:
        sample: as packed.
        new_from_ego: (4, 4).
        grid: cells of the new frame.
    """
    ego_from_new = inverse(new_from_ego)
    (along, across), middle = ego_from_new[:2, :2].T, grid.centres()
    # Rows and columns of cells are turned apart, and added: X 1 2 + 1 Y 2.
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
        grid=grid,
    )


# Light ------------------------------------------------------------------------------------------------------------


def _drawn_light(strength: Augmentation, rng: Generator) -> tuple[float, float, float]:
    """Factors of brightness, contrast and saturation."""
    brightness, contrast, saturation = rng.uniform(-1, 1, 3)
    return (
        1 + brightness * strength.brightness,
        1 + contrast * strength.contrast,
        1 + saturation * strength.saturation,
    )


def relit(sample: Sample, brightness: float, contrast: float, saturation: float) -> Sample:
    """The sample in other light: each colour times `brightness`, then away from middle grey, then from its own grey.

    The same change of single colours is made to the pictures and to the map. A map shows colours as the cameras of
    its time expose them; were it left alone, a network would have to guess what was drawn here and undo it.
    """
    # Three linear changes in a row: colour -> matrix @ colour + offset.
    matrix = saturation * np.eye(3) + (1 - saturation) * np.tile(_GREY, (3, 1))
    offset = np.full(3, (1 - contrast) * 127.5)
    change = np.column_stack([brightness * contrast * matrix, matrix @ offset])
    n, high, wide, _ = sample.images.shape
    images = _changed(sample.images.reshape(n * high, wide, 3), change).reshape(n, high, wide, 3)
    appearance = _changed(np.moveaxis(sample.appearance, 0, 2), change)
    known = (sample.known >> APPEARANCE_BIT & 1).astype(bool)
    return sample._replace(images=images, appearance=np.moveaxis(appearance, 2, 0) * known)


def _changed(rgb: ByteArray, change: FloatArray) -> ByteArray:
    """Colours (H, W, 3) by a linear change (3, 4), rounded and cut off at 0 and 255."""
    return np.asarray(cv2.transform(np.ascontiguousarray(rgb), change), np.uint8)


# Cameras ----------------------------------------------------------------------------------------------------------


def _fewer_cameras(sample: Sample, most: int, rng: Generator) -> Sample:
    """The sample without 0 to `most` of its cameras; one always stays."""
    living = np.flatnonzero(sample.alive)
    count = min(int(rng.integers(most + 1)), len(living) - 1)
    alive = sample.alive.copy()
    alive[rng.permutation(living)[: max(count, 0)]] = False
    return sample._replace(alive=alive)


def _displaced(sample: Sample, strength: Augmentation, rng: Generator) -> Sample:
    """The sample with poses of cameras as a bad calibration has them; pictures and truth stay."""
    n = len(sample.alive)
    directions = rng.normal(size=(2, n, 3))
    steps = directions / np.linalg.norm(directions, axis=-1, keepdims=True) * rng.random((2, n, 1))
    poses = sample.ego_from_cam.copy()
    poses[:, :3, :3] = poses[:, :3, :3] @ Rotation.from_rotvec(steps[0] * strength.extrinsic_rad).as_matrix()
    poses[:, :3, 3] += steps[1] * strength.extrinsic_m
    return sample._replace(ego_from_cam=poses)
