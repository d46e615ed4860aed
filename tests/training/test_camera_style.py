"""Camera style randomisation."""

from __future__ import annotations

import numpy as np
import pytest

from appocc.training.batches.camera_style import CameraStyle, apply_style, apply_tone, draw_style

PLAIN = np.tile(np.arange(256, dtype=np.uint8), (3, 1))


def pictures() -> np.ndarray[tuple[int, ...], np.dtype[np.uint8]]:
    """(2, 32, 64, 3): ramps with an edge in the middle."""
    images = np.zeros((2, 32, 64, 3), np.uint8)
    images[:] = np.linspace(40, 120, 64, dtype=np.uint8)[:, None]
    images[:, :, 32:] += 60
    return images


def test_a_plain_style_changes_nothing() -> None:
    assert np.array_equal(apply_style(pictures(), CameraStyle(PLAIN), np.random.default_rng(0)), pictures())


def test_the_same_seed_draws_the_same_style_and_pictures() -> None:
    first, second = (
        apply_style(pictures(), draw_style(np.random.default_rng(seed)), np.random.default_rng(7)) for seed in (3, 3)
    )
    other = apply_style(pictures(), draw_style(np.random.default_rng(4)), np.random.default_rng(7))
    assert np.array_equal(first, second)
    assert not np.array_equal(first, other)


@pytest.mark.parametrize("seed", range(30))
def test_every_style_gives_pictures_with_something_in_them(seed: int) -> None:
    images = pictures()
    result = apply_style(images, draw_style(np.random.default_rng(seed)), np.random.default_rng(seed))
    assert result.shape == images.shape
    assert result.dtype == np.uint8
    assert np.array_equal(images, pictures())
    # The brighter side stays the brighter one, and the pictures are neither black nor white.
    dark, bright = result[:, 8:24, 20:30].mean(), result[:, 8:24, 34:44].mean()
    assert dark + 10 < bright
    assert 2 < result.mean() < 253


@pytest.mark.parametrize(
    ("style", "sharper"),
    [(CameraStyle(PLAIN, blur_px=1.0), False), (CameraStyle(PLAIN, sharpening=1.0), True)],
    ids=["blur", "sharpening"],
)
def test_edges(style: CameraStyle, sharper: bool) -> None:
    def edge(images: np.ndarray[tuple[int, ...], np.dtype[np.uint8]]) -> int:
        return int(np.abs(np.diff(images[0, 16, 28:36, 0].astype(int))).max())

    result = apply_style(pictures(), style, np.random.default_rng(0))
    assert (edge(result) > edge(pictures())) is sharper


def test_cameras_share_the_tone_and_not_the_noise() -> None:
    style = CameraStyle(PLAIN, noise=8.0)
    first, second = apply_style(pictures(), style, np.random.default_rng(0)).astype(float)
    assert np.abs(first - second).mean() > 3
    assert abs(first.mean() - second.mean()) < 1


def test_the_tone_applies_to_colours_of_any_shape() -> None:
    darker = CameraStyle(np.asarray(PLAIN // 2, np.uint8))
    assert apply_tone(np.full((3, 5, 3), 100, np.uint8), darker).tolist() == np.full((3, 5, 3), 50).tolist()


def test_a_vignette_darkens_corners_only() -> None:
    flat = np.full((1, 32, 64, 3), 200, np.uint8)
    (result,) = apply_style(flat, CameraStyle(PLAIN, vignette=0.5), np.random.default_rng(0))
    assert result[16, 32, 0] >= 198
    assert result[0, 0, 0] == 100
