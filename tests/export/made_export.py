"""Small networks whose answers differ from cell to cell, so that a wrong graph cannot pass for a right one."""

from __future__ import annotations

from pathlib import Path

import torch
from torch import nn

from appocc.camera import CameraRig
from appocc.export.clips import synthetic_clips
from appocc.export.graph import IMAGES, input_shapes
from appocc.grid import BEVGrid
from appocc.models.base import BEVModel
from appocc.models.input_images import fit_camera
from appocc.models.memory import Past
from appocc.models.model_spec import ModelSpec, Parts
from appocc.models.registry import build
from appocc.models.weights import save_weights
from appocc.rigs import read_rig

SMALL = ModelSpec("small", ("CAM_FRONT", "CAM_BACK"), BEVGrid(-8.0, 8.0, -8.0, 8.0, 0.5), 96, 64)
THRESHOLDS = "[0.5, 0.4, 0.3]"
# Three cameras, of which one is named as no setting names it; sizes and shapes differ.
RIG = """
cameras:
  CAM_FRONT: {size_px: [192, 108], fov_deg: 70, position_m: [1.7, 0, 1.5], yaw_deg: 0}
  CAM_BACK: {size_px: [160, 120], fov_deg: 90, position_m: [0, 0, 1.5], yaw_deg: 180}
  CAM_SIDE: {size_px: [96, 64], fov_deg: 90, position_m: [0.5, 0.5, 1.5], yaw_deg: 90}
"""
SIZES_PX = {"CAM_FRONT": (192, 108), "CAM_BACK": (160, 120), "CAM_SIDE": (96, 64)}


ALL_PARTS = Parts(depth=True, memory=True, objects=True)


def network(name: str, spec: ModelSpec = SMALL, parts: Parts | None = None) -> BEVModel:
    """A network with weights that let every part, and every picture, matter."""
    torch.manual_seed(4)
    model = build(name, spec, parts=parts)
    if model.parts.memory:
        nn.init.normal_(model.get_parameter("trunk.recall.fused.weight"), std=0.1)  # a new one ignores its memory
    for norm in (part for part in model.modules() if isinstance(part, nn.BatchNorm2d)):
        nn.init.uniform_(norm.weight, 0.5, 1.5)  # some start at zero, and their blocks would do nothing
        nn.init.uniform_(norm.bias, -0.2, 0.2)
        norm.momentum = None
    rig = fitted_rig(spec)
    shapes = input_shapes(spec, Parts(), len(rig))
    inputs = [torch.from_numpy(clip[0][IMAGES]) for seed in (1, 2) for clip in synthetic_clips(shapes, seed).values()]
    half = len(inputs) // 2
    past = Past(None, torch.eye(2, 3).expand(2, half, 2, 3), torch.full((2, half), 0.5), torch.ones(2, half))
    with torch.no_grad():
        # Statistics of such pictures as are asked about: rounding is not blown up by what never came before.
        model.train()(torch.cat(inputs), model.plan([rig] * len(inputs)), past)
        ends = _ends(model.eval())
        for end in ends:
            nn.init.normal_(end.weight, std=0.1)
            nn.init.zeros_(end.bias)  # type: ignore[arg-type]
        spread = torch.cat([model(images, model.plan([rig])).occupancy for images in inputs]).std()
        for end in ends:
            end.weight /= 3 * spread
    return model


def _ends(model: BEVModel) -> list[nn.Conv2d | nn.Linear]:
    """The last layers: those named so, and those of three outputs, or of six."""
    found = []
    for name, part in model.named_modules():
        if (isinstance(part, nn.Conv2d) and (name.endswith(".answer") or part.out_channels in (3, 6))) or (
            isinstance(part, nn.Linear) and part.out_features == 3
        ):
            found.append(part)
    return found


def fitted_rig(spec: ModelSpec = SMALL) -> CameraRig:
    """The shipped rig's cameras of a setting, as its pictures are fitted."""
    rig = read_rig("paper")
    return CameraRig(tuple(fit_camera(rig[channel], spec) for channel in spec.channels))


def weights_file(path: Path, name: str, spec: ModelSpec = SMALL, parts: Parts | None = None) -> Path:
    """Weights of `network` on disk."""
    save_weights(path, network(name, spec, parts), {"network": name, "thresholds": THRESHOLDS})
    return path
