"""Second stage of cells: road and lane of a map, corrected by the images at their full size."""

from __future__ import annotations

from dataclasses import replace

import torch
from safetensors.torch import load_file
from torch import Tensor
from torch.nn import functional

from appocc.camera import CameraRig
from appocc.checks import Float32Array
from appocc.grid import BEVGrid
from appocc.inference.second_stage.cell_network import CORRECTED, PARTS, CellInputs, CellNetwork
from appocc.inference.second_stage.refiner import WEIGHTS_FOLDER
from appocc.models.batch_norm_folding import fold_batch_norms
from appocc.models.network import cell_coordinates
from appocc.models.view_transform.planning import plan_sampling
from appocc.models.view_transform.sampling import sample_features

# Weights of the second stage of cells, named as the shipped weights that they belong to.
CELL_WEIGHTS_FOLDER = WEIGHTS_FOLDER / "cells"
# Probabilities are clipped to this distance from 0 and 1 before their logits are taken.
_LEAST_PROBABILITY = 1e-4


class CellRefiner:
    """Correct road and lane of a map by the images."""

    def __init__(self, network: CellNetwork, device: torch.device) -> None:
        """Take a trained network to a device."""
        self._network = fold_batch_norms(network).to(device)
        self._device = device

    @classmethod
    def shipped(cls, device: torch.device, name: str) -> CellRefiner | None:
        """Return the second stage of cells of shipped weights by their name; None if they have none."""
        weights = CELL_WEIGHTS_FOLDER / f"{name}.safetensors"
        if not weights.is_file():
            return None
        network = CellNetwork()
        network.load_state_dict(load_file(weights))
        return cls(network.eval(), device)

    def __call__(self, occupancy: Float32Array, images: Tensor, rig: CameraRig, grid: BEVGrid) -> Float32Array:
        """Return the probabilities (3, X, Y) with corrected road and lane.

        Args:
            occupancy: (3, X, Y) predicted probabilities.
            images: (V, 3, H, W) sRGB, 0..1, as the first network sees them.
            rig: their V cameras, in the frame of the grid.
            grid: grid of the map.
        """
        with torch.inference_mode():
            inputs = CellInputs(*(each.to(self._device) for each in cell_inputs(occupancy, images, rig, grid)))
            corrected = self._network(inputs)[0].float().sigmoid().cpu().numpy()
        refined = occupancy.copy()
        refined[list(CORRECTED)] = corrected
        return refined


def cell_inputs(occupancy: Float32Array, images: Tensor, rig: CameraRig, grid: BEVGrid) -> CellInputs:
    """Return the network inputs of a map: its logits, and the colours of its cells on the ground."""
    logits = torch.from_numpy(occupancy).clamp(_LEAST_PROBABILITY, 1 - _LEAST_PROBABILITY).logit()[None]
    rgb, seen = part_colours(images, rig, grid)
    return CellInputs(logits, rgb, seen, cell_distances(grid))


def cell_distances(grid: BEVGrid) -> Tensor:
    """Return the distances (1, 1, X, Y) of cells from the ego, in the unit of `cell_coordinates`."""
    return cell_coordinates(grid)[:, -1:]


def part_colours(images: Tensor, rig: CameraRig, grid: BEVGrid) -> tuple[Tensor, Tensor]:
    """Return colours (1, 27, X, Y), 0..1, on the ground at the parts of cells, and the share (1, 1, X, Y) seen.

    Args:
        images: (V, 3, H, W) sRGB, 0..1.
        rig: their V cameras, in the frame of the grid.
        grid: cells.
    """
    parts = replace(grid, cell_m=grid.cell_m / PARTS)
    high, wide = images.shape[2:]
    plan = plan_sampling([rig], parts, (0.0,), high, wide, 1, device=images.device)
    rgb = sample_features(images.permute(0, 2, 3, 1), plan)
    seen = functional.avg_pool2d(plan.seen[:, None].float(), PARTS)
    return functional.pixel_unshuffle(rgb, PARTS), seen
