"""A pinhole with radial and tangential distortion: OpenCV's plumb-bob and rational models.

After Brown, "Decentering distortion of lenses", 1966, in the form of OpenCV's calib3d: with r^2 = x^2 + y^2,
x' = x g + 2 p1 x y + p2 (r^2 + 2 x^2), y' = y g + p1 (r^2 + 2 y^2) + 2 p2 x y, and
g = (1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6 r^6).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.polynomial import Polynomial

from appocc.checks import FloatArray, check_finite, check_intrinsic, freeze_arrays
from appocc.errors import ShapeError
from appocc.lenses.rising import RisingFunction

COUNTS = (4, 5, 8)
# No such lens sees farther from its axis.
_WIDEST_RAD = np.radians(88.0)
_NEWTON_STEPS = 12
_EXACT = 1e-9


class _Radial(RisingFunction):
    """The distance r g from the axis in the picture, over the focal length, of the distance r of an ideal pinhole."""

    def __init__(self, k: FloatArray) -> None:
        """Take the coefficients k1, k2, p1, p2, k3, k4, k5, k6."""
        self._above, self._below = Polynomial([1.0, k[0], k[1], k[4]]), Polynomial([1.0, k[5], k[6], k[7]])
        super().__init__(float(np.tan(_WIDEST_RAD)))

    def factor(self, r2: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return g and its derivative over r^2, at r^2."""
        with np.errstate(all="ignore"):
            top, bottom = self._above(r2), self._below(r2)
            change = (self._above.deriv()(r2) * bottom - top * self._below.deriv()(r2)) / bottom**2
            return top / bottom, change

    def value(self, places: FloatArray) -> FloatArray:
        """Return r g at r."""
        return np.asarray(places * self.factor(places**2)[0])

    def slope(self, places: FloatArray) -> FloatArray:
        """Return the derivative of r g over r; -1 where the denominator of g is not positive."""
        factor, change = self.factor(places**2)
        return np.where(self._below(places**2) > 0, factor + 2 * places**2 * change, -1.0)


@dataclass(frozen=True, eq=False)
class DistortedLens:
    """Plumb-bob (4 or 5 coefficients) or rational (8) distortion.

    The model holds as far from the axis as its radial part rises: beyond, it would fold the picture back.

    Attributes:
        intrinsic: (3, 3) K in pixels.
        coefficients: (4,), (5,) or (8,) k1, k2, p1, p2[, k3[, k4, k5, k6]].
    """

    intrinsic: FloatArray
    coefficients: FloatArray

    def __post_init__(self) -> None:
        """Check intrinsics and coefficients.

        Raises:
            ShapeError: if one of them is invalid.
        """
        check_intrinsic("intrinsic", self.intrinsic)
        if self.coefficients.shape not in [(count,) for count in COUNTS]:
            raise ShapeError(f"distortion: expected 4, 5 or 8 coefficients, got shape {self.coefficients.shape}")
        check_finite("distortion", self.coefficients)
        freeze_arrays(self, "intrinsic", "coefficients")

    def project(self, points_cam: FloatArray) -> FloatArray:
        """Return the pixels (N, 2) of points (N, 3); NaN for those that the lens does not see."""
        depth = points_cam[:, 2]
        with np.errstate(divide="ignore", invalid="ignore"):
            slopes = points_cam[:, :2] / depth[:, None]
            seen = (depth > 0) & (np.hypot(*slopes.T) <= self._radial.most)
        slopes[~seen] = 0.0
        uv = self._distorted(slopes) @ self.intrinsic[:2, :2].T + self.intrinsic[:2, 2]
        uv[~seen] = np.nan
        return np.asarray(uv)

    def unproject(self, uv_px: FloatArray) -> FloatArray:
        """Return the unit rays (N, 3) that pixels (N, 2) see; NaN for pixels that see nothing."""
        wanted = (uv_px - self.intrinsic[:2, 2]) @ np.linalg.inv(self.intrinsic[:2, :2]).T
        radius = np.hypot(*wanted.T)
        start = self._radial.inverse(np.minimum(radius, self._radial.largest))
        slopes = wanted * np.divide(start, radius, out=np.ones_like(radius), where=radius > 0)[:, None]
        for _ in range(_NEWTON_STEPS):
            slopes = slopes - self._newton_step(slopes, self._distorted(slopes) - wanted)
        with np.errstate(over="ignore", invalid="ignore"):
            off = np.abs(self._distorted(slopes) - wanted).max(axis=1, initial=0.0)
            seen = (off < _EXACT * (1 + radius)) & (np.hypot(*slopes.T) <= self._radial.most)
            rays = np.concatenate([slopes, np.ones((len(slopes), 1))], axis=1)
            rays /= np.linalg.norm(rays, axis=1, keepdims=True)
        rays[~seen] = np.nan
        return rays

    @cached_property
    def _all(self) -> FloatArray:
        return np.pad(self.coefficients, (0, max(COUNTS) - len(self.coefficients)))

    @cached_property
    def _radial(self) -> _Radial:
        return _Radial(self._all)

    def _distorted(self, slopes: FloatArray) -> FloatArray:
        (x, y), (p1, p2) = slopes.T, self._all[2:4]
        with np.errstate(all="ignore"):
            r2 = x * x + y * y
            factor, _ = self._radial.factor(r2)
            return np.stack(
                [
                    x * factor + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
                    y * factor + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
                ],
                axis=1,
            )

    def _newton_step(self, slopes: FloatArray, off: FloatArray) -> FloatArray:
        (x, y), (p1, p2) = slopes.T, self._all[2:4]
        with np.errstate(all="ignore"):
            factor, change = self._radial.factor(x * x + y * y)
            xx = factor + 2 * x * x * change + 2 * p1 * y + 6 * p2 * x
            yy = factor + 2 * y * y * change + 6 * p1 * y + 2 * p2 * x
            xy = 2 * x * y * change + 2 * p1 * x + 2 * p2 * y
            determinant = xx * yy - xy * xy
            step = np.stack([yy * off[:, 0] - xy * off[:, 1], xx * off[:, 1] - xy * off[:, 0]], axis=1)
            return np.asarray(np.nan_to_num(step / determinant[:, None], nan=0.0, posinf=0.0, neginf=0.0))
