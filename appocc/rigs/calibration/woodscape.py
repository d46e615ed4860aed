"""WoodScape's calibration files: JSON with a polynomial fisheye and the camera's pose in the vehicle frame.

The vehicle frame is the ego frame of appocc: on the ground below the middle of the rear axle, x ahead, y left, z up.
"""

from __future__ import annotations

from typing import Any

from appocc.rigs.calibration.wanted import Wanted
from appocc.rigs.fields import Fields


def is_camera(values: Any) -> bool:
    """Whether parsed JSON is a calibration of WoodScape."""
    return isinstance(values, dict) and isinstance(values.get("intrinsic"), dict) and "k1" in values["intrinsic"]


def camera_keys(values: dict[str, Any], wanted: Wanted) -> dict[str, Any]:
    """Return the keys of a camera, as in a rig file.

    Raises:
        DataError: if a value is missing or invalid.
    """
    wanted.refuse_poses()
    lens = Fields(values, wanted.path).inside("intrinsic")
    lens.text("model", ("radial_poly",), "radial_poly")
    size = [lens.number(key, "pixels", 8, 8192, 1280) for key in ("width", "height")]
    shift = [lens.number(key, "pixels", -8192, 8192, 3.9, 0.0) for key in ("cx_offset", "cy_offset")]
    coefficients = [lens.number(f"k{i}", "a coefficient", -1e9, 1e9, 339.7) for i in range(1, 5)]
    aspect = lens.number("aspect_ratio", "a ratio", 0.5, 2.0, 1.0, 1.0)
    keys: dict[str, Any] = {
        "size_px": size,
        "centre_px": [(n - 1) / 2 + off for n, off in zip(size, shift, strict=True)],
        "fisheye": {"model": "polynomial", "coefficients": coefficients, "aspect": aspect},
    }
    if "extrinsic" in values:
        pose = Fields(values, wanted.path).inside("extrinsic")
        keys["ego_from_cam"] = {"quaternion_xyzw": pose["quaternion"], "translation_m": pose["translation"]}
    return keys
