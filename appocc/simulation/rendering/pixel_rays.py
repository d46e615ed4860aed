"""Rays of the pixels of a camera in a town: of a pinhole, or of a camera with any lens, exact for each pixel."""

from __future__ import annotations

from functools import lru_cache
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from appocc.camera import Camera
from appocc.checks import BoolArray, Float32Array, FloatArray
from appocc.rigs.source_camera import SourceCamera
from appocc.simulation.rendering.rays import camera_rays, ray_matrix

# The cameras of a rig: their rays are the same in all frames.
_KEPT_LENSES = 8


class PixelRays(Protocol):
    """The rays of a camera's pixels, town frame.

    Attributes:
        width_px: width of the picture.
        height_px: height of the picture.
        spread_rad: angular width of a pixel in the middle.
        ahead: (3,) float32 unit vector along the optical axis.
        blind: (H * W,) pixels that see nothing; None if all see.
    """

    width_px: int
    height_px: int
    spread_rad: float
    ahead: Float32Array
    blind: BoolArray | None

    def rays(self, pixels: NDArray[np.int32], shift_u: float, shift_v: float) -> tuple[Float32Array, Float32Array]:
        """Return origins and unit directions (N, 3) of pixels (N,), row * width + column, with a subpixel shift."""
        ...


class PinholeRays:
    """The rays of a pinhole camera."""

    blind: BoolArray | None = None

    def __init__(self, camera: Camera, town_from_ego: FloatArray) -> None:
        """Place a camera in the town."""
        self.width_px, self.height_px = camera.width_px, camera.height_px
        self.spread_rad = 1.0 / float(camera.intrinsic[0, 0])
        self.ahead = (town_from_ego[:3, :3] @ camera.ego_from_cam[:3, 2]).astype(np.float32)
        self._matrix, self._place = ray_matrix(camera, town_from_ego)

    def rays(self, pixels: NDArray[np.int32], shift_u: float, shift_v: float) -> tuple[Float32Array, Float32Array]:
        """Return origins and unit directions (N, 3) of pixels (N,), row * width + column, with a subpixel shift."""
        return camera_rays(pixels, self.width_px, shift_u, shift_v, self._matrix, self._place)


class LensRays:
    """The rays of a camera with any lens."""

    blind: BoolArray | None

    def __init__(self, camera: SourceCamera, town_from_ego: FloatArray) -> None:
        """Place a camera in the town."""
        self.width_px, self.height_px = camera.width_px, camera.height_px
        pose = town_from_ego @ camera.ego_from_cam
        self._camera, self._turn, self._place = camera, pose[:3, :3], pose[:3, 3].astype(np.float32)
        self.ahead = pose[:3, 2].astype(np.float32)
        self._middle, self.blind = _rays_of(camera)
        self.spread_rad = _spread_rad(camera)

    def rays(self, pixels: NDArray[np.int32], shift_u: float, shift_v: float) -> tuple[Float32Array, Float32Array]:
        """Return origins and unit directions (N, 3) of pixels (N,), row * width + column, with a subpixel shift."""
        in_cam = self._middle[pixels]
        if shift_u or shift_v:
            row, column = np.divmod(pixels, self.width_px)
            moved = self._camera.lens.unproject(np.stack([column + shift_u, row + shift_v], axis=1))
            in_cam = np.where(np.isnan(moved), in_cam, moved)
        directions = np.ascontiguousarray(in_cam @ self._turn.T, np.float32)
        return np.tile(self._place, (len(pixels), 1)), directions


@lru_cache(maxsize=_KEPT_LENSES)
def _rays_of(camera: SourceCamera) -> tuple[FloatArray, BoolArray]:
    """Return the rays (H * W, 3) of all pixels, camera frame, and which see nothing; those look along the axis."""
    v, u = np.divmod(np.arange(camera.width_px * camera.height_px), camera.width_px)
    rays = camera.lens.unproject(np.stack([u, v], axis=1).astype(np.float64))
    blind = np.asarray(np.isnan(rays).any(axis=1))
    rays[blind] = [0.0, 0.0, 1.0]
    return rays, blind


@lru_cache(maxsize=_KEPT_LENSES)
def _spread_rad(camera: SourceCamera) -> float:
    """Return the angle between the rays of two neighbouring pixels on the axis."""
    axis = camera.lens.project(np.array([[0.0, 0.0, 1.0]]))
    one, other = camera.lens.unproject(np.concatenate([axis, axis + np.array([1.0, 0.0])]))
    return float(np.linalg.norm(np.cross(one, other)))
