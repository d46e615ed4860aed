from __future__ import annotations

import numpy as np
import pytest

from appocc.srgb import LINEAR_OF_BYTE, decode_srgb, encode_srgb, linear_from_srgb


def test_encoding_and_decoding_are_inverse() -> None:
    share = np.linspace(0, 1, 1001)
    np.testing.assert_allclose(decode_srgb(encode_srgb(share)), share, atol=1e-6)
    np.testing.assert_allclose(encode_srgb(decode_srgb(share)), share, atol=1e-6)


def test_known_values() -> None:
    assert encode_srgb([0.0, 0.002, 0.214041, 1.0]).tolist() == pytest.approx([0, 0.02584, 0.5, 1], abs=1e-5)


def test_bytes_and_numbers_give_the_same() -> None:
    every = np.arange(256)
    assert linear_from_srgb(every.astype(np.uint8)).tolist() == linear_from_srgb(every).tolist()
    assert linear_from_srgb(every).tolist() == LINEAR_OF_BYTE.tolist()


def test_nan_stays_nan() -> None:
    assert np.isnan(encode_srgb([np.nan])).all()
    assert np.isnan(linear_from_srgb([np.nan])).all()
