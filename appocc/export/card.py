"""Model card of an exported file: one JSON object with everything needed to use it without this project."""

from __future__ import annotations

import json
from collections.abc import Mapping
from importlib import metadata
from typing import Any

from appocc.bevmap import CLASSES
from appocc.camera import Camera, CameraRig
from appocc.export.graph import (
    APPEARANCE,
    ELAPSED,
    IMAGES,
    MEMORY,
    NEXT_MEMORY,
    OBJECT_BOX,
    OBJECT_CENTRE,
    OCCUPANCY,
    PAST_FROM_NOW,
    SEEN,
    input_shapes,
)
from appocc.models.base import VELOCITY_UNIT_MPS
from appocc.models.input_images import fit_camera
from appocc.models.model_spec import ModelSpec, Parts
from appocc.models.weights import read_thresholds
from appocc.objects import KINDS

ENTRY = "card"
VERSION = "1"
BOX_CHANNELS = (
    "x of the centre from the centre of the cell, cells",
    "y of the centre from the centre of the cell, cells",
    "z of the centre, metres",
    "logarithm of the width in metres",
    "logarithm of the length in metres",
    "logarithm of the height in metres",
    "sine of the heading, not normalised",
    "cosine of the heading, not normalised",
    f"velocity along x, {VELOCITY_UNIT_MPS:g} m/s",
    f"velocity along y, {VELOCITY_UNIT_MPS:g} m/s",
    "sine of twice the heading, not normalised",
    "cosine of twice the heading, not normalised",
)
_INPUT_MEANINGS = {
    IMAGES: "pictures of the cameras in their order; sRGB, red first, 0..1",
    MEMORY: f"{NEXT_MEMORY} of the frame before; zeros for the first frame of a drive",
    PAST_FROM_NOW: "ego motion on the ground: rotation, and translation in metres, of points now to the frame before",
    ELAPSED: "seconds since the frame before",
}


def make_card(
    weights_card: Mapping[str, str],
    weights: Mapping[str, str],
    spec: ModelSpec,
    rig: CameraRig,
    rig_name: str,
    packages: tuple[str, ...],
) -> dict[str, Any]:
    """Make the model card of an exported network.

    Args:
        weights_card: model card of the weights file.
        weights: name and digest of the weights file.
        spec: model spec of the network.
        rig: original cameras, in the order of the images.
        rig_name: name of the rig.
        packages: packages whose versions are recorded.
    """
    grid = spec.grid
    parts = Parts.of(json.loads(weights_card.get("parts", "[]")))
    inputs = {
        name: {"name": name, "shape": list(shape), "type": "float32", "says": _INPUT_MEANINGS[name]}
        for name, shape in input_shapes(spec, parts, len(rig)).items()
    }
    images = inputs.pop(IMAGES)
    return {
        "version": VERSION,
        "network": weights_card["network"],
        "setting": spec.name,
        "classes": list(CLASSES),
        "thresholds": dict(zip(CLASSES, read_thresholds(weights_card), strict=True)),
        "input": images,
        **({"memory_inputs": inputs} if inputs else {}),
        "outputs": _outputs(spec, parts, bool(json.loads(weights_card["appearance"]))),
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


def _outputs(spec: ModelSpec, parts: Parts, appearance: bool) -> dict[str, Any]:
    """Return shape, type and meaning of the outputs by name."""
    half = spec.grid.halved()
    cells = [1, 3, *spec.grid.shape]
    outputs: dict[str, Any] = {OCCUPANCY: {"shape": cells, "type": "float32", "says": "probabilities of the classes"}}
    if appearance:
        outputs[APPEARANCE] = {"shape": cells, "type": "float32", "says": "sRGB colours, red first, 0..1"}
    if parts.objects:
        for name, channels, meaning in (
            (OBJECT_CENTRE, KINDS, "probabilities of object centres"),
            (OBJECT_BOX, BOX_CHANNELS, "box of the object whose centre is in the cell"),
        ):
            shape = [1, len(channels), *half.shape]
            about = {"channels": list(channels), "cell_m": half.cell_m}
            outputs[name] = {"shape": shape, "type": "float32", "says": meaning, **about}
    if parts.memory:
        shape = list(input_shapes(spec, parts, 0)[MEMORY])
        outputs[NEXT_MEMORY] = {"shape": shape, "type": "float32", "says": f"{MEMORY} for the next frame"}
    outputs[SEEN] = {"shape": list(spec.grid.shape), "type": "bool", "says": "cells that a camera sees, by geometry"}
    return outputs


def _camera(camera: Camera, spec: ModelSpec) -> dict[str, Any]:
    """Return a camera, how its image is resized and cropped, and the intrinsics of the result."""
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
    """Return the size of the resized image before cropping, from the ratio of the focal lengths."""
    scales = (fit.intrinsic[i, i] / camera.intrinsic[i, i] for i in (0, 1))
    width, height = (
        round(size * scale) for size, scale in zip((camera.width_px, camera.height_px), scales, strict=True)
    )
    return width, height


def card_text(card: Mapping[str, Any]) -> str:
    """Return the card as the text that is written into a file."""
    return json.dumps(card)
