"""Second stage of cells: colours of painted ground, corrections by a made network, and the shipped one on drives."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import torch
from made_street import YAW, camera
from torch import Tensor

from appocc.bevmap import LANE, ROAD, VEHICLE, load_map
from appocc.camera import Camera, CameraRig
from appocc.checks import BoolArray, Float32Array, FloatArray
from appocc.grid import BEVGrid
from appocc.inference.inputs import dataset_inputs
from appocc.inference.loading import load_predictor
from appocc.inference.predictor import Predictor
from appocc.inference.second_stage.cell_network import CELL_PARTS, PARTS, CellInputs, CellNetwork
from appocc.inference.second_stage.cell_refiner import CellRefiner, cell_inputs, part_colours
from appocc.models.shipped import PACKAGED
from appocc.nuscenes import Dataset

CPU = torch.device("cpu")
GRID = BEVGrid(-8.0, 8.0, -8.0, 8.0, 0.4)
RIG = CameraRig(tuple(camera(channel) for channel in YAW))
# A line along x, narrower than a cell and not in the middle of one, and its colours.
LINE_Y_M, LINE_WIDTH_M = 1.05, 0.2
PAINT, ASPHALT = (0.9, 0.8, 0.2), (0.3, 0.3, 0.3)


def on_line(y_m: FloatArray) -> BoolArray:
    return np.asarray(np.abs(y_m - LINE_Y_M) < LINE_WIDTH_M / 2)


def painted_ground(one: Camera) -> FloatArray:
    """The image (3, H, W), 0..1, of flat ground with the line."""
    v, u = np.mgrid[: one.height_px, : one.width_px]
    rays = np.stack([u, v, np.ones_like(u)], axis=-1) @ np.linalg.inv(one.intrinsic).T @ one.ego_from_cam[:3, :3].T
    down = np.minimum(rays[..., 2], -1e-6)
    y_m = one.ego_from_cam[1, 3] - one.ego_from_cam[2, 3] / down * rays[..., 1]
    return np.asarray(np.where(on_line(y_m)[..., None], PAINT, ASPHALT).transpose(2, 0, 1))


IMAGES = torch.from_numpy(np.stack([painted_ground(one) for one in RIG])).float()


def test_parts_have_the_colours_of_the_ground_at_their_places() -> None:
    rgb, seen = part_colours(IMAGES, RIG, GRID)
    assert rgb.shape == (1, 3 * CELL_PARTS, *GRID.shape)
    x, y = np.meshgrid(np.arange(5, 7.5, 0.4), np.arange(-1, 2, 0.4), indexing="ij")  # ahead, near
    cells = GRID.cell_of(np.stack([x, y], axis=-1).reshape(-1, 2))
    parts = rgb[0].reshape(3, PARTS, PARTS, *GRID.shape).numpy()
    offsets = (np.arange(PARTS) - 1) * GRID.cell_m / PARTS
    right = []
    for cell in cells:
        assert seen[0, 0, cell[0], cell[1]] == 1
        for i in range(PARTS):
            for j in range(PARTS):
                at_y = GRID.centre_of(cell)[1] + offsets[j]
                if np.abs(np.abs(at_y - LINE_Y_M) - LINE_WIDTH_M / 2) > 0.04:  # not at an edge of the line
                    expected = np.array(PAINT if on_line(at_y) else ASPHALT)
                    right.append(np.abs(parts[:, i, j, cell[0], cell[1]] - expected).max() < 0.1)
    assert np.mean(right) > 0.95


def test_cells_under_the_ego_are_not_seen_and_black() -> None:
    rgb, seen = part_colours(IMAGES[:1], CameraRig((RIG["CAM_FRONT"],)), GRID)
    behind = GRID.cell_of([-4.0, 0.0])
    assert seen[0, 0, behind[0], behind[1]] == 0
    assert (rgb[0, :, behind[0], behind[1]] == 0).all()
    assert ((seen >= 0) & (seen <= 1)).all()


def inputs_of(occupancy: FloatArray) -> CellInputs:
    return cell_inputs(occupancy.astype(np.float32), IMAGES, RIG, GRID)


def test_a_new_network_leaves_the_probabilities_as_they_are() -> None:
    occupancy = np.random.default_rng(0).uniform(0.05, 0.95, (3, *GRID.shape)).astype(np.float32)
    refined = CellRefiner(CellNetwork().eval(), CPU)(occupancy, IMAGES, RIG, GRID)
    np.testing.assert_allclose(refined, occupancy, atol=1e-6)


class _SaysLaneWherePaint(CellNetwork):
    """Says that the road is where it is likely already, and a lane line where the middle part of a cell is bright."""

    def forward(self, inputs: CellInputs) -> Tensor:
        middle = inputs.rgb[:, CELL_PARTS // 2]
        return torch.stack([inputs.logits[:, ROAD] * 2, (middle - 0.6) * 20], dim=1)


def test_road_and_lane_are_those_of_the_network_and_vehicles_stay() -> None:
    occupancy = np.full((3, *GRID.shape), 0.2, np.float32)
    before = occupancy.copy()
    refined = CellRefiner(_SaysLaneWherePaint(), CPU)(occupancy, IMAGES, RIG, GRID)
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


def as_predicted(occupancy: Float32Array, *_: object) -> Float32Array:
    """No second stage of cells."""
    return occupancy


def test_the_default_weights_find_lane_lines_better_with_their_stage(simulated_root: Path) -> None:
    without = load_predictor(None, CPU, cell_stage=as_predicted)
    assert lane_iou(simulated_root, load_predictor(None, CPU)) > lane_iou(simulated_root, without) + 0.02


def test_other_weights_have_no_stage_of_cells(simulated_root: Path, tmp_path: Path) -> None:
    own = tmp_path / "own.safetensors"
    shutil.copy(PACKAGED, own)
    frame = dataset_inputs(Dataset(simulated_root), [Dataset(simulated_root).scenes[0]])[0].read().frame
    for weights in (own, "street"):
        bare = load_predictor(weights, CPU)(frame).bev.occupancy
        without = load_predictor(weights, CPU, cell_stage=as_predicted)(frame).bev.occupancy
        np.testing.assert_array_equal(bare, without)
    default = load_predictor(None, CPU)(frame).bev.occupancy
    assert not np.array_equal(load_predictor(own, CPU)(frame).bev.occupancy[LANE], default[LANE])
