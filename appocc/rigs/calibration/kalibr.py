"""Kalibr's camera chains: camchain.yaml and camchain-imucam.yaml."""

from __future__ import annotations

from typing import Any

import numpy as np

from appocc.checks import FloatArray, check_transform
from appocc.errors import DataError, ShapeError
from appocc.geometry import inverse
from appocc.rigs.calibration.wanted import Wanted
from appocc.rigs.fields import Fields

BASES = ("ego_from_imu", "ego_from_cam0")
_MODELS = ("radtan", "equidistant", "none")


def is_chain(values: Any) -> bool:
    """Whether parsed YAML is a camera chain."""
    return isinstance(values, dict) and any(
        isinstance(camera, dict) and {"camera_model", "intrinsics"} <= set(camera) for camera in values.values()
    )


def camera_keys(values: dict[str, Any], wanted: Wanted) -> dict[str, Any]:
    """Return the keys of a camera, as in a rig file; with its pose, if the pose of the IMU or of cam0 is known.

    Raises:
        DataError: if the chain has no such camera, or a lens or pose that cannot be read.
    """
    names = [str(name) for name, camera in values.items() if isinstance(camera, dict) and "intrinsics" in camera]
    name = wanted.choose(names)
    camera = Fields(values[name], wanted.path, name)
    camera.text("camera_model", ("pinhole",))
    fx, fy, cx, cy = camera.numbers("intrinsics", [4], "fu, fv, pu, pv", "[461.6, 460.3, 363.0, 248.1]")
    keys: dict[str, Any] = {
        "size_px": camera.numbers("resolution", [2], "width and height", "[752, 480]").tolist(),
        "intrinsic": [[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]],
    }
    model = camera.text("distortion_model", _MODELS, "none")
    if model != "none":
        k = camera.numbers("distortion_coeffs", [4], "4 coefficients", "[-0.28, 0.07, 0.0002, 0.00002]").tolist()
        keys |= {"distortion": k} if model == "radtan" else {"fisheye": {"coefficients": k}}
    return keys | _pose(values, names[: names.index(name) + 1], wanted)


def _pose(values: dict[str, Any], chain: list[str], wanted: Wanted) -> dict[str, Any]:
    """Return ego_from_cam if a base is known; `chain` are the cameras from the first to the wanted one."""
    if len(wanted.bases) > 1:
        raise DataError(f"{wanted.path}: expected either {BASES[0]} or {BASES[1]}, got both")
    if "ego_from_imu" in wanted.bases:
        cam_from_imu = _transform(Fields(values[chain[-1]], wanted.path, chain[-1]), "T_cam_imu")
        return {"ego_from_cam": (wanted.bases["ego_from_imu"] @ inverse(cam_from_imu)).tolist()}
    if "ego_from_cam0" in wanted.bases:
        pose = wanted.bases["ego_from_cam0"]
        for name in chain[1:]:
            pose = pose @ inverse(_transform(Fields(values[name], wanted.path, name), "T_cn_cnm1"))
        return {"ego_from_cam": pose.tolist()}
    return {}


def _transform(camera: Fields, key: str) -> FloatArray:
    matrix = camera.matrix(key, [(4, 4)], "4 rows of 4 numbers", "[[1, 0, 0, 0.1], [0, 1, 0, 0], ...]")
    try:
        check_transform(key, matrix)
    except ShapeError as error:
        raise DataError(f"{camera.where}: {error}") from error
    return np.asarray(matrix)
