"""A network without weights: what it answers is known, so that what is done around it can be judged."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np
import torch
from tiny_dataset import TinyDataset, token
from torch import Tensor

from appocc.bevmap import LANE, ROAD, VEHICLE, BEVMap, bev_path
from appocc.camera import CameraRig
from appocc.grid import BEVGrid
from appocc.inference.predictor import Predictor, Weights
from appocc.models.base import BEVModel, ModelOutput
from appocc.models.memory import Past
from appocc.models.model_spec import ModelSpec

GRID = BEVGrid(-16.0, 16.0, -16.0, 16.0, 0.4)
CHANNELS = ("CAM_FRONT_LEFT", "CAM_FRONT", "CAM_FRONT_RIGHT", "CAM_BACK")
AROUND = ModelSpec("360", CHANNELS, GRID, 16, 8)
AHEAD = ModelSpec("180", CHANNELS[:3], BEVGrid(0.0, 16.0, -16.0, 16.0, 0.4), 16, 8)
# Probabilities that lie on either side of the thresholds below.
LOW, HIGH = 0.45, 0.8


class MadePlan(NamedTuple):
    """Cells on the side to which a camera looks."""

    seen: Tensor

    def to(self, device: torch.device) -> Self:
        return self

    def for_export(self) -> Self:
        return self


class MadeModel(BEVModel):
    """Says that there is road to the right, a lane mark at the left and a car 10 m ahead; all in the mean colour."""

    def __init__(self, spec: ModelSpec = AROUND, colour: bool = True) -> None:
        super().__init__()
        self.spec = spec
        self.rigs: list[CameraRig] = []
        self._colour = colour

    def plan(self, rigs: Sequence[CameraRig]) -> MadePlan:
        self.rigs += rigs
        centres = self.spec.grid.centres()
        ahead = [np.stack([camera.ego_from_cam[:2, 2] for camera in rig]) for rig in rigs]
        return MadePlan(torch.from_numpy(np.stack([(centres @ axes.T > 0).any(axis=-1) for axes in ahead])))

    def forward(  # type: ignore[override]
        self, images: Tensor, plan: MadePlan, past: Past | None = None
    ) -> ModelOutput:
        assert images.shape == (1, len(self.rigs[-1]), 3, self.spec.height_px, self.spec.width_px)
        x, y = (torch.from_numpy(axis) for axis in np.moveaxis(self.spec.grid.centres(), -1, 0))
        on = torch.zeros(1, 3, *x.shape)
        on[0, ROAD, y < 0] = HIGH
        on[0, LANE, y > 15] = LOW
        on[0, VEHICLE, (x - 10).abs().lt(2.3) & y.abs().lt(1)] = LOW
        mean = images.mean(dim=(1, 3, 4))[:, :, None, None]
        return ModelOutput(torch.logit(on, 1e-4), mean.expand(1, 3, *x.shape) if self._colour else None, None)


def predictor(model: MadeModel | None = None, digest: str = "d1") -> Predictor:
    """The made model with thresholds that let the car be seen and the lane not."""
    weights = Weights("made", digest, {"road": 0.5, "vehicle": 0.4, "lane": 0.5})
    return Predictor(model or MadeModel(), weights, torch.device("cpu"))


def save_road_everywhere(tiny: TinyDataset) -> None:
    """Save true maps of the tiny dataset with road in every cell."""
    for i in range(3):
        on = np.zeros((3, *GRID.shape), np.float32)
        on[ROAD] = 1
        known = np.ones((3, *GRID.shape), np.bool_)
        truth = BEVMap(GRID, on, known, np.zeros((3, *GRID.shape), np.uint8), known[0].copy())
        truth.save(bev_path(tiny.root, "exact", token("sample", i)))
