"""Predictor: a network with its weights, from frames to bird's-eye-view maps."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, Protocol

import numpy as np
import torch
from torch import Tensor

from appocc.bevmap import BEVMap
from appocc.camera import Camera, CameraRig
from appocc.checks import BoolArray, ByteArray, Float32Array, FloatArray
from appocc.errors import DataError
from appocc.frame import Frame
from appocc.geometry import apply, inverse
from appocc.inference.decision_thresholds import decision_thresholds
from appocc.inference.exposure import brightening_exponent
from appocc.inference.second_stage.ground_colours import GroundView
from appocc.models.base import BEVModel, ViewTransformPlan
from appocc.models.input_images import fit_image, select_channels
from appocc.models.memory import MEMORY_AGE_S, MIN_MEMORY_AGE_S, Past, ground_motion, is_linked
from appocc.models.model_spec import ModelSpec
from appocc.models.object_decoding import decode_objects, fuse_vehicles, paint_objects, rescore_objects
from appocc.objects import BEVObjects

# A second stage: from the objects of a map, the network's images (V, 3, H, W) and their cameras to corrected objects.
Refine = Callable[[BEVObjects, ByteArray, Iterable[Camera]], BEVObjects]

# Version of what a map depends on besides its inputs and weights: change it with the values of maps.
MAP_RULES = 10
# Lower predicted speeds of vehicles, most of which are parked, and of people are within the error: unknown.
_LEAST_SPEED_MPS, _LEAST_WALKING_MPS = 2.0, 1.0


@dataclass(frozen=True)
class Weights:
    """Identity and thresholds of a network's weights.

    Attributes:
        name: name for display.
        digest: SHA-256 of the file; maps from the same weights need not be predicted again.
        thresholds: decision threshold of each class, chosen on validation data; a map has its own, near these.
        object_threshold: lowest score of an object, chosen on validation data.
    """

    name: str
    digest: str
    thresholds: Mapping[str, float]
    object_threshold: float = 0.5

    def as_meta(self) -> dict[str, str]:
        """Return the entry for the meta of a map."""
        return {"name": self.name, "sha256": self.digest}


class Prediction(NamedTuple):
    """BEV prediction.

    Attributes:
        bev: probabilities and colours of all cells; valid are the cells that a camera of the rig sees.
        seen: (X, Y) bool, the valid cells; elsewhere the network guesses.
    """

    bev: BEVMap
    seen: BoolArray


class CellStage(Protocol):
    """A second stage of cells."""

    def reset(self) -> None:
        """Forget all frames: the next frame is the first of a drive."""

    def __call__(self, occupancy: Float32Array, view: GroundView) -> Float32Array:
        """Return the corrected probabilities (3, X, Y) of the next frame."""


class _Memory(NamedTuple):
    """Memory of a network after a frame."""

    state: Tensor
    world_from_ego: FloatArray
    timestamp_us: int

    def link(self, frame: Frame) -> tuple[FloatArray, float]:
        """Return the ego motion on the ground, (2, 3) past_from_now, and the seconds from this memory to a frame."""
        motion = ground_motion(self.world_from_ego, frame.world_from_ego)
        return motion, (frame.timestamp_us - self.timestamp_us) / 1e6


class Predictor:
    """Predict the maps of a drive, one frame at a time.

    With memory or a stage of cells, pass the frames in order of time and call `reset` before another drive. A break
    in time or a jump of the pose resets the memory. A frame uses the memory of about one second ago: with shorter
    steps the errors of the network would feed themselves. The view-transform plan is reused while the rig stays the
    same. The network sees the cameras in the level frame of the ground; boxes are returned in the ego frame, which
    differs from it by a tilt of a few degrees at most, and the cells of the map in that of the ground.
    """

    def __init__(
        self,
        model: BEVModel,
        weights: Weights,
        device: torch.device,
        second_stage: Refine | None = None,
        cell_stage: CellStage | None = None,
    ) -> None:
        """Move a network to the device, in evaluation mode; objects and cells without a stage stay uncorrected."""
        self.model = model.to(device).eval()
        self.weights = weights
        self._device = device
        self._second_stage, self._cell_stage = second_stage, cell_stage
        self._cached_plan: tuple[CameraRig, ViewTransformPlan] | None = None
        self._memories: deque[_Memory] = deque()

    @property
    def has_memory(self) -> bool:
        """Whether a map depends on the frames before."""
        return self.model.parts.memory or self._cell_stage is not None

    def reset(self) -> None:
        """Forget all frames: the next frame is the first of a drive."""
        self._memories.clear()
        if self._cell_stage is not None:
            self._cell_stage.reset()

    def __call__(self, frame: Frame) -> Prediction:
        """Predict the map of a frame from its images.

        Raises:
            DataError: if the frame has no image that the model uses, or the model output is not finite.
        """
        spec = self.model.spec
        stacked, rig = stack_images(frame, spec)
        rig = _levelled(rig, frame.ego_from_level)
        plan = self._plan(rig)
        images = stacked.to(self._device).float()[None] / 255
        exponent = brightening_exponent(images)
        images = images**exponent if exponent < 1 else images
        past = self._past(frame)
        with torch.inference_mode():
            output = self.model(images, plan, past)
            occupancy = output.occupancy[0].float().sigmoid().cpu().numpy()
            colour = None if output.appearance is None else output.appearance[0].float().cpu().numpy()
        seen = plan.seen[0].cpu().numpy()
        shape = spec.grid.shape
        rgb = np.zeros((3, *shape)) if colour is None else colour.clip(0, 1) ** (1 / exponent) * 255
        if not np.isfinite(occupancy).all() or not np.isfinite(rgb).all():
            raise DataError(f"{frame.token}: the model output is not finite; are its weights ({self.weights.name})?")
        if self._cell_stage is not None:
            view = GroundView(images[0], rig, spec.grid, frame.world_from_ego, frame.timestamp_us)
            occupancy = self._cell_stage(occupancy, view)
        if output.memory is not None:
            self._memories.append(_Memory(output.memory, frame.world_from_ego, frame.timestamp_us))
        objects = None
        if output.objects is not None:
            objects = decode_objects(output.objects, spec.grid, seen, moving=past is not None)
            objects = rescore_objects(_without_low_speeds(objects), spec.grid, occupancy)
            if colour is not None:
                objects = paint_objects(objects, spec.grid, occupancy, rgb, seen)
            if self._second_stage is not None:
                objects = self._second_stage(objects, stacked.numpy(), rig)
            occupancy = fuse_vehicles(objects, spec.grid, occupancy)
            if frame.ego_from_level is not None:
                objects = replace(objects, centre_m=apply(frame.ego_from_level, objects.centre_m))
        known, coloured = np.broadcast_to(seen, (3, *shape)).copy(), seen & (colour is not None)
        thresholds = decision_thresholds(occupancy, seen, spec.grid, self.weights.thresholds)
        meta = self._meta(frame, list(rig.channels), thresholds)
        bev = BEVMap(spec.grid, occupancy, known, rgb.round().astype(np.uint8), coloured, meta, objects)
        return Prediction(bev, seen)

    def _past(self, frame: Frame) -> Past | None:
        """Return the link to a frame of a second ago, less at the beginning of a drive; None if there is none."""
        memories = self._memories
        if memories and not is_linked(*memories[-1].link(frame)):
            memories.clear()
        while len(memories) > 1 and memories[1].link(frame)[1] >= MEMORY_AGE_S:
            memories.popleft()
        if not memories:
            return None
        motion, elapsed_s = memories[0].link(frame)
        if elapsed_s < MIN_MEMORY_AGE_S:
            return None
        numbers = torch.from_numpy(motion).float()[None, None], torch.tensor([[elapsed_s]]), torch.ones(1, 1)
        return Past(memories[0].state, *numbers).to(self._device)

    def _plan(self, rig: CameraRig) -> ViewTransformPlan:
        if self._cached_plan is None or self._cached_plan[0] != rig:
            self._cached_plan = (rig, self.model.plan([rig]).to(self._device))
        return self._cached_plan[1]

    def _meta(self, frame: Frame, channels: list[str], thresholds: dict[str, float]) -> dict[str, Any]:
        return {
            "source": "predicted",
            "weights": self.weights.as_meta(),
            "thresholds": thresholds,
            **({"object_threshold": self.weights.object_threshold} if self.model.parts.objects else {}),
            "setting": self.model.spec.name,
            "cameras": channels,
            **({} if frame.ego_from_level is None else {"ego_from_level": frame.ego_from_level.round(5).tolist()}),
            "token": frame.token,
            "timestamp_us": frame.timestamp_us,
        }


def _without_low_speeds(objects: BEVObjects) -> BEVObjects:
    """Return the objects, with unknown velocities where the predicted ones are low."""
    least = np.where(objects.are_vehicles, _LEAST_SPEED_MPS, _LEAST_WALKING_MPS)
    slow = np.hypot(*objects.velocity_mps.T) < least
    return replace(objects, velocity_mps=np.where(slow[:, None], np.nan, objects.velocity_mps))


def _levelled(rig: CameraRig, ego_from_level: FloatArray | None) -> CameraRig:
    """Return a rig with the camera poses in the level frame of the ground."""
    if ego_from_level is None:
        return rig
    turn = inverse(ego_from_level)
    return rig.with_cameras(replace(camera, ego_from_cam=turn @ camera.ego_from_cam) for camera in rig)


def stack_images(frame: Frame, spec: ModelSpec) -> tuple[Tensor, CameraRig]:
    """Return the network input of a frame, (N, 3, H, W) uint8 sRGB, and the rig of these images.

    Raises:
        DataError: if the frame has no image that the model uses.
    """
    working = frame.rig.select(frame.images)
    pairs = [fit_image(frame.images[camera.channel], camera, spec) for camera in select_cameras(spec, working)]
    if not pairs:
        raise DataError(f"{frame.token}: expected an image of {', '.join(spec.channels)}, got none")
    stacked = np.stack([image for image, _ in pairs]).transpose(0, 3, 1, 2)
    return torch.from_numpy(np.ascontiguousarray(stacked)), frame.rig.with_cameras(camera for _, camera in pairs)


def select_cameras(spec: ModelSpec, rig: CameraRig) -> list[Camera]:
    """Return the cameras of a rig that a model uses, in the order of `select_channels`."""
    return [rig[channel] for channel in select_channels(spec, rig.channels)]
