"""Second stage of cells: corrections by a made network, and the shipped one on drives."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import torch
from painted_ground import GRID, on_line, view_at
from torch import Tensor

from appocc.bevmap import LANE, ROAD, VEHICLE, load_map
from appocc.checks import Float32Array, FloatArray
from appocc.inference.inputs import dataset_inputs
from appocc.inference.loading import load_predictor
from appocc.inference.predictor import Predictor
from appocc.inference.second_stage.cell_network import CELL_PARTS, CellInputs, CellNetwork
from appocc.inference.second_stage.cell_refiner import CellRefiner, cell_inputs
from appocc.inference.second_stage.ground_colours import GroundColours, GroundView
from appocc.models.shipped import PACKAGED
from appocc.nuscenes import Dataset

CPU = torch.device("cpu")
VIEW = view_at(0.0)


def inputs_of(occupancy: FloatArray) -> CellInputs:
    return cell_inputs(occupancy.astype(np.float32), *GroundColours()(VIEW), GRID)


def test_a_new_network_leaves_the_probabilities_as_they_are() -> None:
    occupancy = np.random.default_rng(0).uniform(0.05, 0.95, (3, *GRID.shape)).astype(np.float32)
    refined = CellRefiner(CellNetwork().eval(), CPU)(occupancy, VIEW)
    np.testing.assert_allclose(refined, occupancy, atol=1e-6)


class _SaysLaneWherePaint(CellNetwork):
    """Says that the road is where it is likely already, and a lane line where the middle part of a cell is bright."""

    def forward(self, inputs: CellInputs) -> Tensor:
        middle = inputs.rgb[:, CELL_PARTS // 2]
        return torch.stack([inputs.logits[:, ROAD] * 2, (middle - 0.6) * 20], dim=1)


def test_road_and_lane_are_those_of_the_network_and_vehicles_stay() -> None:
    occupancy = np.full((3, *GRID.shape), 0.2, np.float32)
    before = occupancy.copy()
    refined = CellRefiner(_SaysLaneWherePaint(), CPU)(occupancy, VIEW)
    np.testing.assert_array_equal(occupancy, before)
    np.testing.assert_array_equal(refined[VEHICLE], before[VEHICLE])
    np.testing.assert_allclose(refined[ROAD], 1 / (1 + 4**2), rtol=1e-4)
    ahead = refined[LANE][GRID.cell_of([6.0, 0.0])[0]]
    np.testing.assert_array_equal(ahead > 0.5, on_line(GRID.centres()[0, :, 1]))
    assert refined.dtype == np.float32


def test_the_light_of_the_scene_does_not_matter() -> None:
    torch.manual_seed(0)
    network = CellNetwork().eval()
    torch.nn.init.normal_(network.answer.weight)
    inputs = inputs_of(np.full((3, *GRID.shape), 0.3))
    lighter = inputs._replace(rgb=inputs.rgb + 0.1)
    with torch.inference_mode():
        one, other = network(inputs), network(lighter)
    assert (one - inputs.logits[:, [ROAD, LANE]]).abs().max() > 0.1
    torch.testing.assert_close(one, other, rtol=0, atol=1e-3)


def lane_iou(root: Path, predictor: Predictor) -> float:
    """IoU of lane lines in the maps of the first samples of all scenes."""
    dataset, both, either = Dataset(root), 0, 0
    for scene in dataset.scenes:
        predictor.reset()
        given = dataset_inputs(dataset, [scene])[0]
        predicted = predictor(given.read().frame).bev.occupancy[LANE] >= predictor.weights.thresholds["lane"]
        true = load_map(root, "exact", given.token).occupancy[LANE] > 0.5
        both, either = both + int((predicted & true).sum()), either + int((predicted | true).sum())
    return both / either


class _AsPredicted:
    """No second stage of cells."""

    def reset(self) -> None:
        """Nothing is remembered."""

    def __call__(self, occupancy: Float32Array, view: GroundView) -> Float32Array:
        return occupancy


def test_the_default_weights_find_lane_lines_better_with_their_stage(simulated_root: Path) -> None:
    without = load_predictor(None, CPU, cell_stage=_AsPredicted())
    assert lane_iou(simulated_root, load_predictor(None, CPU)) > lane_iou(simulated_root, without) + 0.02


def test_other_weights_have_no_stage_of_cells(simulated_root: Path, tmp_path: Path) -> None:
    own = tmp_path / "own.safetensors"
    shutil.copy(PACKAGED, own)
    frame = dataset_inputs(Dataset(simulated_root), [Dataset(simulated_root).scenes[0]])[0].read().frame
    for weights in (own, "street"):
        bare = load_predictor(weights, CPU)(frame).bev.occupancy
        without = load_predictor(weights, CPU, cell_stage=_AsPredicted())(frame).bev.occupancy
        np.testing.assert_array_equal(bare, without)
    default = load_predictor(None, CPU)(frame).bev.occupancy
    assert not np.array_equal(load_predictor(own, CPU)(frame).bev.occupancy[LANE], default[LANE])


def test_a_map_depends_on_the_earlier_frames_of_its_drive_alone(simulated_root: Path) -> None:
    dataset, predictor = Dataset(simulated_root), load_predictor(None, CPU)
    first, second = (given.read().frame for given in dataset_inputs(dataset, [dataset.scenes[0]])[:2])
    predictor(first)
    after = predictor(second).bev.occupancy
    predictor.reset()
    alone = predictor(second).bev.occupancy
    predictor.reset()
    predictor(first)
    np.testing.assert_array_equal(predictor(second).bev.occupancy, after)
    assert not np.array_equal(alone[LANE], after[LANE])
