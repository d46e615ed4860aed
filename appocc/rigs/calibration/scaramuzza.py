"""OCamCalib's calibration file, calib_results.txt: rows of numbers below lines of comment."""

from __future__ import annotations

from typing import Any

from appocc.errors import DataError
from appocc.rigs.calibration.wanted import Wanted
from appocc.rigs.fields import Fields

# The blocks of the file in their order; the first number of the first two is how many follow.
_BLOCKS = ("polynomial coefficients for the direct mapping", "inverse mapping", "center", "affine", "image size")


def is_camera(text: str) -> bool:
    """Whether a text is a calibration of OCamCalib."""
    return "mapping function" in text and "affine parameters" in text


def camera_keys(text: str, wanted: Wanted) -> dict[str, Any]:
    """Return the keys of a camera, as in a rig file.

    Raises:
        DataError: if a block is missing or invalid.
    """
    wanted.refuse_poses()
    rows = [line.split() for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")]
    if len(rows) != len(_BLOCKS):
        expected = ", ".join(_BLOCKS)
        raise DataError(f"{wanted.path}: expected a row of numbers for each of {expected}, got {len(rows)} rows")
    read = Fields(dict(zip(_BLOCKS, rows, strict=True)), wanted.path)
    count, *direct = read.numbers(_BLOCKS[0], (), "their number and a0, a1, ...", "3 -200 0 1.7e-3").tolist()
    if count != len(direct):
        raise read.refusal(_BLOCKS[0], f"{len(direct)} in front of {len(direct)} coefficients")
    row, column = read.numbers("center", [2], "row and column", "480 640").tolist()
    height, width = read.numbers("image size", [2], "height and width", "960 1280").tolist()
    affine = read.numbers("affine", [3], "c, d and e", "0.9999 0.0003 -0.0002").tolist()
    return {
        "size_px": [width, height],
        "centre_px": [column, row],
        "fisheye": {"model": "ocamcalib", "coefficients": direct, "affine": affine},
    }
