"""Fisheye lenses: the distance from the centre of the picture is a function of the angle from the axis.

Four published families, all up to 200 degrees wide and more:
- Kannala and Brandt, "A generic camera model and calibration method for conventional, wide-angle, and fish-eye
  lenses", PAMI 2006, in the form of OpenCV's cv2.fisheye;
- a polynomial of the angle in pixels, as WoodScape's calibration files have it (Yogamani et al., ICCV 2019);
- Scaramuzza et al., "A toolbox for easily calibrating omnidirectional cameras", IROS 2006 (OCamCalib);
- Mei and Rives, "Single view point omnidirectional camera calibration from planar grids", ICRA 2007 (unified sphere).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import Polynomial

from appocc.checks import FloatArray, check_finite, check_intrinsic, check_shape, freeze_arrays
from appocc.errors import ShapeError
from appocc.lenses.rising import Inverted, Rising, RisingFunction

# Across. A lens whose own width is not told is taken to be as wide as its picture, at most this.
WIDEST_DEG = 200.0
_FARTHEST_PX = 8192.0


class _AnglePolynomial(RisingFunction):
    """The distance from the centre as a polynomial of the angle."""

    def __init__(self, coefficients: Sequence[float], wide_deg: float) -> None:
        """Take c1, c2, ... of the angle's powers."""
        self._polynomial = Polynomial([0.0, *coefficients])
        super().__init__(np.radians(wide_deg) / 2)

    def value(self, places: FloatArray) -> FloatArray:
        """Return the distances at angles (N,)."""
        return np.asarray(self._polynomial(places))

    def slope(self, places: FloatArray) -> FloatArray:
        """Return the derivatives at angles (N,)."""
        return np.asarray(self._polynomial.deriv()(places))


class _MirrorAngle(RisingFunction):
    """The angle of OCamCalib's ray at a distance from the centre."""

    def __init__(self, coefficients: Sequence[float]) -> None:
        """Take a0, a1, ... of the distance's powers."""
        self._ahead = -Polynomial(list(coefficients))
        super().__init__(_FARTHEST_PX)

    def value(self, places: FloatArray) -> FloatArray:
        """Return the angles at distances (N,)."""
        return np.asarray(np.arctan2(places, self._ahead(places)))

    def slope(self, places: FloatArray) -> FloatArray:
        """Return the derivatives at distances (N,)."""
        ahead = self._ahead(places)
        return np.asarray((ahead - places * self._ahead.deriv()(places)) / (places**2 + ahead**2))


class _SphereAngle(RisingFunction):
    """The distance from the centre of a point on the unit sphere, seen from xi behind its centre, with distortion."""

    def __init__(self, xi: float, k: Sequence[float], wide_deg: float) -> None:
        """Take the mirror parameter and k1, k2."""
        self._xi, self._distortion = xi, Polynomial([0.0, 1.0, 0.0, k[0], 0.0, k[1]])
        super().__init__(np.radians(wide_deg) / 2)

    def value(self, places: FloatArray) -> FloatArray:
        """Return the distances at angles (N,)."""
        return np.asarray(self._distortion(np.sin(places) / (np.cos(places) + self._xi)))

    def slope(self, places: FloatArray) -> FloatArray:
        """Return the derivatives at angles (N,)."""
        ahead = np.cos(places) + self._xi
        rho, change = np.sin(places) / ahead, (1 + self._xi * np.cos(places)) / ahead**2
        return np.where(ahead > 0, self._distortion.deriv()(rho) * change, -1.0)


@dataclass(frozen=True, eq=False)
class FisheyeLens:
    """A lens that puts a ray at `skew @ (cos, sin) * profile(angle) + centre_px`.

    Attributes:
        profile: distance from the centre, by angle from the axis in radians; its range is what the lens sees.
        skew: (2, 2) pixels right and down per distance right and down.
        centre_px: (2,) pixel on the axis.
    """

    profile: Rising
    skew: FloatArray
    centre_px: FloatArray

    def __post_init__(self) -> None:
        """Check shapes.

        Raises:
            ShapeError: if one is invalid.
        """
        check_shape("skew", self.skew, (2, 2))
        check_shape("centre_px", self.centre_px, (2,))
        check_finite("skew", self.skew)
        check_finite("centre_px", self.centre_px)
        if not np.linalg.det(self.skew) > 0:
            raise ShapeError("fisheye: expected pixels that are no mirror image and not flat")
        if not self.profile.most > np.radians(1.0):
            raise ShapeError("fisheye: expected pixels farther from the centre for larger angles, got nearer ones")
        freeze_arrays(self, "skew", "centre_px")

    def project(self, points_cam: FloatArray) -> FloatArray:
        """Return the pixels (N, 2) of points (N, 3); NaN for those that the lens does not see."""
        across = np.hypot(points_cam[:, 0], points_cam[:, 1])
        distance = self.profile(np.arctan2(across, points_cam[:, 2]))
        # On the axis there is no direction, and no distance.
        towards = np.zeros((len(across), 2))
        np.divide(points_cam[:, :2], across[:, None], out=towards, where=across[:, None] > 0)
        return np.asarray((towards * distance[:, None]) @ self.skew.T + self.centre_px)

    def unproject(self, uv_px: FloatArray) -> FloatArray:
        """Return the unit rays (N, 3) that pixels (N, 2) see; NaN for pixels that see nothing."""
        place = (uv_px - self.centre_px) @ np.linalg.inv(self.skew).T
        distance = np.hypot(*place.T)
        angle = self.profile.inverse(distance)
        towards = np.divide(place, distance[:, None], out=np.zeros_like(place), where=distance[:, None] > 0)
        return np.concatenate([towards * np.sin(angle)[:, None], np.cos(angle)[:, None]], axis=1)


def kannala_brandt(intrinsic: FloatArray, k: Sequence[float], wide_deg: float = WIDEST_DEG) -> FisheyeLens:
    """Return the fisheye of cv2.fisheye: distance = a (1 + k1 a^2 + k2 a^4 + k3 a^6 + k4 a^8) of the angle a.

    Args:
        intrinsic: (3, 3) K in pixels; its skew is used.
        k: k1 to k4.
        wide_deg: how wide the lens sees, across.

    Raises:
        ShapeError: if a value is invalid.
    """
    check_intrinsic("intrinsic", intrinsic)
    check_shape("fisheye coefficients", np.asarray(k), (4,))
    profile = _AnglePolynomial([1.0, 0.0, k[0], 0.0, k[1], 0.0, k[2], 0.0, k[3]], wide_deg)
    return FisheyeLens(profile, np.array(intrinsic[:2, :2]), np.array(intrinsic[:2, 2]))


def polynomial_fisheye(
    coefficients: Sequence[float], centre_px: Sequence[float], aspect: float = 1.0, wide_deg: float = WIDEST_DEG
) -> FisheyeLens:
    """Return the fisheye of a polynomial: distance = c1 a + c2 a^2 + ... pixels of the angle a.

    Args:
        coefficients: c1, c2, ...
        centre_px: pixel on the axis; WoodScape writes it as the shift from the centre of the picture.
        aspect: pixels down per pixel right.
        wide_deg: how wide the lens sees, across.

    Raises:
        ShapeError: if a value is invalid.
    """
    profile = _AnglePolynomial(coefficients, wide_deg)
    return FisheyeLens(profile, np.diag([1.0, aspect]), np.asarray(centre_px, np.float64))


def ocamcalib(
    polynomial: Sequence[float],
    centre_px: Sequence[float],
    affine: Sequence[float] = (1.0, 0.0, 0.0),
    wide_deg: float = WIDEST_DEG,
) -> FisheyeLens:
    """Return OCamCalib's fisheye: the ray at distance d from the centre is (x, y, -(a0 + a1 d + a2 d^2 + ...)).

    Args:
        polynomial: a0, a1, ... of "direct mapping"; a0 is negative, as its z axis points backwards.
        centre_px: pixel (u, v) on the axis: the file's "center" is row, column, that is v, u.
        affine: c, d, e: row = c x + d y, column = e x + y, for x down and y right.
        wide_deg: how wide the lens sees, across.

    Raises:
        ShapeError: if a value is invalid.
    """
    c, d, e = affine
    if not polynomial[0] < 0:
        raise ShapeError(f"fisheye: expected a negative first coefficient a0, got {polynomial[0]:g}")
    profile = Inverted(_MirrorAngle(polynomial), np.radians(wide_deg) / 2)
    return FisheyeLens(profile, np.array([[1.0, e], [d, c]]), np.asarray(centre_px, np.float64))


def unified_sphere(
    xi: float,
    k: Sequence[float],
    focal_px: Sequence[float],
    centre_px: Sequence[float],
    wide_deg: float = WIDEST_DEG,
) -> FisheyeLens:
    """Return Mei's fisheye: distance = rho (1 + k1 rho^2 + k2 rho^4), rho = sin a / (cos a + xi) of the angle a.

    Args:
        xi: mirror parameter, 0 or more.
        k: k1, k2. Tangential distortion, less than a pixel in KITTI-360, is left out as in its own tools.
        focal_px: gamma1, gamma2: pixels right and down per distance.
        centre_px: pixel on the axis.
        wide_deg: how wide the lens sees, across.

    Raises:
        ShapeError: if a value is invalid.
    """
    check_shape("fisheye coefficients", np.asarray(k), (2,))
    check_finite("fisheye coefficients", np.array([xi, *k]))
    if xi < 0:
        raise ShapeError(f"fisheye: expected a mirror parameter xi of 0 or more, got {xi:g}")
    return FisheyeLens(_SphereAngle(xi, k, wide_deg), np.diag(focal_px), np.asarray(centre_px, np.float64))
