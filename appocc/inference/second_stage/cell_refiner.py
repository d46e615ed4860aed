"""Second stage of cells: road and lane of a map, corrected by the images at their full size."""

from __future__ import annotations

import torch
from safetensors.torch import load_file
from torch import Tensor

from appocc.checks import Float32Array
from appocc.grid import BEVGrid
from appocc.inference.second_stage.cell_network import CORRECTED, CellInputs, CellNetwork
from appocc.inference.second_stage.ground_colours import GroundColours, GroundView
from appocc.inference.second_stage.refiner import WEIGHTS_FOLDER
from appocc.models.batch_norm_folding import fold_batch_norms
from appocc.models.network import cell_coordinates

# Weights of the second stage of cells, named as the shipped weights that they belong to.
CELL_WEIGHTS_FOLDER = WEIGHTS_FOLDER / "cells"
# Probabilities are clipped to this distance from 0 and 1 before their logits are taken.
_LEAST_PROBABILITY = 1e-4


class CellRefiner:
    """Correct road and lane of the maps of a drive by the images, one frame at a time."""

    def __init__(self, network: CellNetwork, device: torch.device) -> None:
        """Take a trained network to a device."""
        self._network = fold_batch_norms(network).to(device)
        self._device = device
        self._ground = GroundColours()

    @classmethod
    def shipped(cls, device: torch.device, name: str) -> CellRefiner | None:
        """Return the second stage of cells of shipped weights by their name; None if they have none."""
        weights = CELL_WEIGHTS_FOLDER / f"{name}.safetensors"
        if not weights.is_file():
            return None
        network = CellNetwork()
        network.load_state_dict(load_file(weights))
        return cls(network.eval(), device)

    def reset(self) -> None:
        """Forget all frames: the next frame is the first of a drive."""
        self._ground.reset()

    def __call__(self, occupancy: Float32Array, view: GroundView) -> Float32Array:
        """Return the probabilities (3, X, Y) of the next frame with corrected road and lane.

        Args:
            occupancy: (3, X, Y) predicted probabilities.
            view: the images as the first network sees them.
        """
        with torch.inference_mode():
            inputs = cell_inputs(occupancy, *self._ground(view), view.grid)
            corrected = self._network(CellInputs(*(each.to(self._device) for each in inputs)))
        refined = occupancy.copy()
        refined[list(CORRECTED)] = corrected[0].float().sigmoid().cpu().numpy()
        return refined


def cell_inputs(occupancy: Float32Array, rgb: Tensor, seen: Tensor, grid: BEVGrid) -> CellInputs:
    """Return the network inputs of a map.

    Args:
        occupancy: (3, X, Y) predicted probabilities.
        rgb: (1, 27, X, Y) colours, 0..1, of the ground at the parts of cells.
        seen: (1, 1, X, Y) share of the parts that are seen.
        grid: grid of the map.
    """
    logits = torch.from_numpy(occupancy).clamp(_LEAST_PROBABILITY, 1 - _LEAST_PROBABILITY).logit()[None]
    return CellInputs(logits, rgb, seen, cell_distances(grid))


def cell_distances(grid: BEVGrid) -> Tensor:
    """Return the distances (1, 1, X, Y) of cells from the ego, in the unit of `cell_coordinates`."""
    return cell_coordinates(grid)[:, -1:]
