from __future__ import annotations

import pytest
import torch

from appocc.inference.exposure import DARK, brightening_exponent


@pytest.mark.parametrize("mean", [DARK, 0.45, 1.0])
def test_pictures_by_day_are_left_as_they_are(mean: float) -> None:
    assert brightening_exponent(torch.full((2, 3, 4, 5), mean)) == 1.0


def test_even_dark_pictures_get_the_mean_of_those_by_day() -> None:
    images = torch.full((2, 3, 4, 5), 0.1)
    assert (images ** brightening_exponent(images)).mean() == pytest.approx(DARK, abs=1e-6)


def test_black_pictures_are_brightened_within_limits() -> None:
    images = torch.zeros(1, 3, 4, 5)
    exponent = brightening_exponent(images)
    assert 0.3 < exponent < 0.5
    assert (images**exponent == 0).all()
