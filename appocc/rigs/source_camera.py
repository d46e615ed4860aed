"""A camera as it is mounted: its lens, the size of its picture, and its pose."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from appocc.checks import BoolArray, FloatArray, check_transform, freeze_arrays
from appocc.errors import ShapeError
from appocc.lenses import DistortedLens, Lens

# Columns and rows of the pixels whose rays identify a lens.
_PROBES = (9, 7)


@dataclass(frozen=True, eq=False)
class SourceCamera:
    """A camera with any lens.

    Attributes:
        name: the user's name of the camera, and of its pictures without the ending.
        channel: nuScenes channel of the pinhole camera, such as CAM_FRONT; start of the names if there are several.
        width_px: width of the picture.
        height_px: height of the picture.
        lens: the lens.
        ego_from_cam: (4, 4) pose of the camera frame (x right, y down, z ahead) in the ego frame, metres.
    """

    name: str
    channel: str
    width_px: int
    height_px: int
    lens: Lens
    ego_from_cam: FloatArray

    def __post_init__(self) -> None:
        """Check size and pose.

        Raises:
            ShapeError: if one is invalid.
        """
        if self.width_px < 1 or self.height_px < 1:
            raise ShapeError(f"{self.name}: expected an image size, got {self.width_px}x{self.height_px}")
        check_transform(f"{self.name} ego_from_cam", self.ego_from_cam)
        freeze_arrays(self, "ego_from_cam")

    @property
    def pinhole(self) -> DistortedLens | None:
        """The lens if its pictures are a pinhole's as they are."""
        lens = self.lens
        return lens if isinstance(lens, DistortedLens) and not lens.coefficients.any() else None

    def sees(self, uv_px: FloatArray) -> BoolArray:
        """Return whether pixels (N, 2), as the lens projects, are between the outermost pixel centres."""
        with np.errstate(invalid="ignore"):
            last = np.array([self.width_px - 1, self.height_px - 1])
            return np.asarray(((uv_px >= 0) & (uv_px <= last)).all(axis=1))

    def as_json(self) -> dict[str, Any]:
        """Return JSON values that identify the camera; its lens by some of the rays."""
        columns, rows = (
            np.linspace(0, n - 1, count) for n, count in zip((self.width_px, self.height_px), _PROBES, strict=True)
        )
        pixels = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2)
        rays = np.nan_to_num(self.lens.unproject(pixels)).round(6) + 0.0
        return {
            "channel": self.channel,
            "size_px": [self.width_px, self.height_px],
            "rays": rays.tolist(),
            "ego_from_cam": self.ego_from_cam.tolist(),
        }
