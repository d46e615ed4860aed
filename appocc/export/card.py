"""What an exported file says of itself, so that it can be used without this project: one JSON object."""

from __future__ import annotations

import json
from collections.abc import Mapping
from importlib import metadata
from typing import Any

from appocc.bevmap import CLASSES
from appocc.camera import Camera, CameraRig
from appocc.export.graph import APPEARANCE, INPUT, OCCUPANCY, SEEN
from appocc.models.input_images import fit_camera
from appocc.models.model_spec import ModelSpec
from appocc.models.weights import read_thresholds

ENTRY = "card"
VERSION = "1"


def card_of(
    weights_card: Mapping[str, str],
    weights: Mapping[str, str],
    spec: ModelSpec,
    rig: CameraRig,
    rig_name: str,
    packages: tuple[str, ...],
) -> dict[str, Any]:
    """The card of an exported network.

    Args:
        weights_card: as in the file of weights.
        weights: name and digest of that file.
        setting: of the network.
        rig: the cameras as they are, in the order of the pictures.
        rig_name: where it comes from.
        packages: whose versions are told.
    """
    grid = spec.grid
    cells = [1, 3, *grid.shape]
    outputs = {OCCUPANCY: {"shape": cells, "type": "float32", "says": "probabilities of the classes"}}
    if json.loads(weights_card["appearance"]):
        outputs[APPEARANCE] = {"shape": cells, "type": "float32", "says": "sRGB colours, red first, 0..1"}
    outputs[SEEN] = {"shape": list(grid.shape), "type": "bool", "says": "cells that a camera sees, by geometry"}
    return {
        "version": VERSION,
        "network": weights_card["network"],
        "setting": spec.name,
        "classes": list(CLASSES),
        "thresholds": dict(zip(CLASSES, read_thresholds(weights_card), strict=True)),
        "input": {
            "name": INPUT,
            "shape": [1, len(rig), 3, spec.height_px, spec.width_px],
            "type": "float32",
            "says": "pictures of the cameras in their order; sRGB, red first, 0..1",
        },
        "outputs": outputs,
        "grid": {
            "x_min_m": grid.x_min_m,
            "x_max_m": grid.x_max_m,
            "y_min_m": grid.y_min_m,
            "y_max_m": grid.y_max_m,
            "cell_m": grid.cell_m,
            "says": "ego frame: x ahead, then y to the left; cell 0 lies at the minimum",
        },
        "rig": rig_name,
        "cameras": [_camera(camera, spec) for camera in rig],
        "weights": {**weights, "card": dict(weights_card)},
        "versions": {name: metadata.version(name) for name in ("appocc", "torch", *packages)},
    }


def _camera(camera: Camera, spec: ModelSpec) -> dict[str, Any]:
    """A camera, how its picture is fitted, and the intrinsics of the fitted picture."""
    fit = fit_camera(camera, spec)
    width, height = _resized(camera, fit)
    whole = camera.resized(width, height)
    left, top = (round(whole.intrinsic[i, 2] - fit.intrinsic[i, 2]) for i in (0, 1))
    return {
        "channel": camera.channel,
        "size_px": [camera.width_px, camera.height_px],
        "resize_px": [width, height],
        "interpolation": "INTER_AREA" if width < camera.width_px else "INTER_LINEAR",
        "crop_px": [left, top, fit.width_px, fit.height_px],
        "intrinsic": fit.intrinsic.tolist(),
        "ego_from_cam": camera.ego_from_cam.tolist(),
    }


def _resized(camera: Camera, fit: Camera) -> tuple[int, int]:
    """Size that the whole picture is resized to before it is cut, from what became of the focal lengths."""
    scales = (fit.intrinsic[i, i] / camera.intrinsic[i, i] for i in (0, 1))
    width, height = (
        round(size * scale) for size, scale in zip((camera.width_px, camera.height_px), scales, strict=True)
    )
    return width, height


def text_of(card: Mapping[str, Any]) -> str:
    """The card as it is written into a file."""
    return json.dumps(card)
