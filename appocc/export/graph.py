"""Export graph: a network and one rig as a single function from images, and memory, to outputs by name."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from appocc.camera import CameraRig
from appocc.models.base import BEVModel, ModelOutput, ObjectOutput, ViewTransformPlan
from appocc.models.batch_norm_folding import fold_batch_norms
from appocc.models.lean_trunk import LeanTrunk
from appocc.models.memory import Past
from appocc.models.model_spec import ModelSpec, Parts

IMAGES, MEMORY, PAST_FROM_NOW, ELAPSED = "images", "memory", "past_from_now", "elapsed_s"
OCCUPANCY, APPEARANCE, SEEN = "occupancy", "appearance", "seen"
OBJECT_CENTRE, OBJECT_BOX = "object_centre", "object_box"
# ONNX does not allow an output with the name of an input.
NEXT_MEMORY = "next_memory"


def input_shapes(spec: ModelSpec, parts: Parts, cameras: int) -> dict[str, tuple[int, ...]]:
    """Return the shapes of the inputs by name: images, and the memory of a network that has one."""
    shapes: dict[str, tuple[int, ...]] = {IMAGES: (1, cameras, 3, spec.height_px, spec.width_px)}
    if parts.memory:
        memory = (1, LeanTrunk.memory_channels, *spec.grid.halved().shape)
        shapes |= {MEMORY: memory, PAST_FROM_NOW: (1, 2, 3), ELAPSED: (1,)}
    return shapes


class ExportGraph(nn.Module):
    """Outputs by name of the images of a rig, and of the memory; everything that depends on the rig is a constant.

    Batch norms are folded, and only operations are used that every runtime supports.
    """

    def __init__(self, model: BEVModel, rig: CameraRig) -> None:
        """Copy a network and plan it for a rig, with the cameras after `fit_camera`.

        Raises:
            ShapeError: if the image size of a camera differs from the model spec.
        """
        super().__init__()
        self.model = fold_batch_norms(model)
        self.plan = model.plan([rig]).for_export()
        self.seen = self.plan.seen[0]
        self.shapes = input_shapes(model.spec, model.parts, len(rig))
        self.eval()

    def forward(self, *inputs: Tensor) -> dict[str, Tensor]:
        """Return the outputs by name, from inputs in the order of `input_shapes`."""
        return run_network(self.model, self.plan, dict(zip(self.shapes, inputs, strict=True)))


def run_network(model: BEVModel, plan: ViewTransformPlan, inputs: dict[str, Tensor]) -> dict[str, Tensor]:
    """Return the outputs of a network by name, from inputs by name; without a memory the frame is a first one."""
    past = None
    if MEMORY in inputs:
        elapsed = inputs[ELAPSED][None]
        past = Past(inputs[MEMORY], inputs[PAST_FROM_NOW][None], elapsed, torch.ones_like(elapsed))
    return named_outputs(model(inputs[IMAGES], plan, past))


def named_outputs(output: ModelOutput) -> dict[str, Tensor]:
    """Return the outputs of an exported network by name: logits as probabilities, boxes as one array."""
    outputs = {OCCUPANCY: torch.sigmoid(output.occupancy.float())}
    if output.appearance is not None:
        outputs[APPEARANCE] = output.appearance.float()
    if output.objects is not None:
        outputs[OBJECT_CENTRE] = torch.sigmoid(output.objects.centre)
        outputs[OBJECT_BOX] = _boxes(output.objects)
    if output.memory is not None:
        outputs[NEXT_MEMORY] = output.memory.float()
    return outputs


def _boxes(objects: ObjectOutput) -> Tensor:
    """Return (B, 12, X/2, Y/2); `card.BOX_CHANNELS` names the channels."""
    return torch.cat(objects[1:], dim=1)
