"""Intrinsics and lenses of rig files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from rig_texts import AHEAD, read_one

from appocc.lenses import DistortedLens, FisheyeLens

SIZE = "size_px: [640, 480]"


def lens_of(folder: Path, *keys: str) -> DistortedLens | FisheyeLens:
    lens = read_one(folder, SIZE, AHEAD, *keys).cameras[0].lens
    assert isinstance(lens, DistortedLens | FisheyeLens)
    return lens


@pytest.mark.parametrize(
    ("fov_deg", "more"),
    [
        (70, ()),
        (100, ("distortion: [-0.2, 0.04, 0, 0]",)),
        (100, ("distortion: [0.5, -0.1, 0, 0, 0.01, 0.9, 0.02, 0.001]",)),
        (190, ("fisheye: [0.02, -0.005, 0.001, 0]",)),
    ],
)
def test_a_field_of_view_is_that_of_the_picture(tmp_path: Path, fov_deg: int, more: tuple[str, ...]) -> None:
    lens = lens_of(tmp_path, f"fov_deg: {fov_deg}", *more)
    half = np.radians(fov_deg) / 2
    ((u, v),) = lens.project(np.array([[np.sin(half), 0.0, np.cos(half)]]))
    assert (u, v) == pytest.approx((319.5 + 320, 239.5))


def test_focal_lengths_and_centre(tmp_path: Path) -> None:
    one = lens_of(tmp_path, "focal_px: 500")
    assert isinstance(one, DistortedLens)
    assert one.intrinsic.tolist() == [[500, 0, 319.5], [0, 500, 239.5], [0, 0, 1]]
    two = lens_of(tmp_path, "focal_px: [500, 510]", "centre_px: [321, 238]")
    assert isinstance(two, DistortedLens)
    assert two.intrinsic.tolist() == [[500, 0, 321], [0, 510, 238], [0, 0, 1]]


def test_numbers_that_yaml_reads_as_texts(tmp_path: Path) -> None:
    lens = lens_of(tmp_path, "fov_deg: 70", "distortion: [-3e-1, 1e-1, 1e-5, 0]")
    assert isinstance(lens, DistortedLens)
    assert lens.coefficients.tolist() == [-0.3, 0.1, 1e-5, 0]


def test_fisheyes_in_pixels(tmp_path: Path) -> None:
    ray = np.array([[np.sin(1.0), 0.0, np.cos(1.0)]])
    keys = ("fisheye: {model: polynomial, coefficients: [200, -10], aspect: 1.1}", "centre_px: [320, 240]")
    assert lens_of(tmp_path, *keys).project(ray)[0] == pytest.approx([510, 240])
    mirror = "fisheye: {model: ocamcalib, coefficients: [-200, 0, 0.001], affine: [0.99, 0, 0]}"
    (ahead,) = lens_of(tmp_path, mirror).unproject(np.array([[419.5, 239.5]]))
    assert ahead == pytest.approx(np.array([100, 0, 190]) / np.hypot(100, 190))
