"""A network with its weights, ready to answer frames with maps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor

from appocc.bevmap import CLASSES, BEVMap
from appocc.camera import Camera, CameraRig
from appocc.checks import BoolArray
from appocc.errors import DataError
from appocc.frame import Frame
from appocc.models.base import BEVModel, Plan
from appocc.models.input_images import channels_of, fitted
from appocc.models.model_spec import Setting


@dataclass(frozen=True)
class Weights:
    """Which weights a network has.

    Attributes:
        name: for people.
        digest: of the file: maps of the same weights need not be made again.
        thresholds: by class, chosen on validation data.
    """

    name: str
    digest: str
    thresholds: Mapping[str, float]

    def as_meta(self) -> dict[str, str]:
        """As in the meta of a map."""
        return {"name": self.name, "sha256": self.digest}


class Prediction(NamedTuple):
    """An answer.

    Attributes:
        bev: float probabilities and colours of all cells; valid are those that a camera of the rig sees.
        seen: (X, Y) these cells; elsewhere the network guesses.
    """

    bev: BEVMap
    seen: BoolArray


class Predictor:
    """Answers one frame at a time; the plan of a rig is kept as long as the rig stays the same."""

    def __init__(self, model: BEVModel, weights: Weights, device: torch.device) -> None:
        """Take a network; it is put on the device and into evaluation mode."""
        self.model = model.to(device).eval()
        self.weights = weights
        self._device = device
        self._planned: tuple[CameraRig, Plan] | None = None

    def __call__(self, frame: Frame) -> Prediction:
        """The map of a frame, from the images that it has.

        Raises:
            DataError: if it has no image that the setting uses.
        """
        setting = self.model.setting
        pictures, rig = pictures_of(frame, setting)
        plan = self._plan(rig)
        images = pictures.to(self._device).float()[None] / 255
        with torch.inference_mode():
            output = self.model(images, plan)
            occupancy = output.occupancy[0].float().sigmoid().cpu().numpy()
            colour = None if output.appearance is None else output.appearance[0].float().cpu().numpy()
        seen = plan.seen[0].cpu().numpy()
        shape = setting.grid.shape
        rgb = np.zeros((3, *shape)) if colour is None else colour.clip(0, 1) * 255
        if not np.isfinite(occupancy).all() or not np.isfinite(rgb).all():
            raise DataError(
                f"{frame.token}: the network's answer is not finite; are its weights ({self.weights.name})?"
            )
        known, coloured = np.broadcast_to(seen, (3, *shape)).copy(), seen & (colour is not None)
        meta = self._meta(frame, list(rig.channels))
        bev = BEVMap(setting.grid, occupancy, known, rgb.round().astype(np.uint8), coloured, meta)
        return Prediction(bev, seen)

    def _plan(self, rig: CameraRig) -> Plan:
        if self._planned is None or self._planned[0] != rig:
            self._planned = (rig, self.model.plan([rig]).to(self._device))
        return self._planned[1]

    def _meta(self, frame: Frame, channels: list[str]) -> dict[str, Any]:
        return {
            "source": "predicted",
            "weights": self.weights.as_meta(),
            "thresholds": {name: float(self.weights.thresholds[name]) for name in CLASSES},
            "setting": self.model.setting.name,
            "cameras": channels,
            "token": frame.token,
            "timestamp_us": frame.timestamp_us,
        }


def pictures_of(frame: Frame, setting: Setting) -> tuple[Tensor, CameraRig]:
    """What a network of a setting sees of a frame: (N, 3, H, W) uint8 sRGB, and the cameras of such pictures.

    Raises:
        DataError: if the frame has no image that the setting uses.
    """
    working = frame.rig.select(frame.images)
    pairs = [fitted(frame.images[camera.channel], camera, setting) for camera in cameras_of(setting, working)]
    if not pairs:
        raise DataError(f"{frame.token}: expected a picture of {', '.join(setting.channels)}, got none")
    stacked = np.stack([picture for picture, _ in pairs]).transpose(0, 3, 1, 2)
    return torch.from_numpy(np.ascontiguousarray(stacked)), frame.rig.with_cameras(camera for _, camera in pairs)


def cameras_of(setting: Setting, rig: CameraRig) -> list[Camera]:
    """The cameras of a rig that a setting uses, in the order of `channels_of`."""
    return [rig[channel] for channel in channels_of(setting, rig.channels)]
