"""Colours of painted ground at the parts of cells, in one frame and in a drive."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from painted_ground import ASPHALT, GRID, LINE_WIDTH_M, LINE_Y_M, PAINT, RIG, on_line, view_at
from torch import Tensor

from appocc.camera import CameraRig
from appocc.inference.second_stage.cell_network import CELL_PARTS, PARTS
from appocc.inference.second_stage.ground_colours import GroundColours

FRONT = CameraRig((RIG["CAM_FRONT"],))
# A cell of the line behind the front camera.
BEHIND = GRID.cell_of([-2.0, LINE_Y_M])
OTHER_PAINT = (0.9, 0.2, 0.2)


def colour_behind(rgb: Tensor) -> Tensor:
    """Colour (3,) of the middle part of the cell behind."""
    return rgb[0].reshape(3, CELL_PARTS, *GRID.shape)[:, CELL_PARTS // 2, BEHIND[0], BEHIND[1]]


def drive(colours: GroundColours, step_m: float = 2.5) -> tuple[Tensor, Tensor]:
    """Drive ten metres with a front camera, at five metres a second; the last colours."""
    for x_m in np.arange(0, 10, step_m):
        colours(view_at(x_m, x_m / 5, FRONT))
    return colours(view_at(10.0, 2.0, FRONT))


def test_parts_have_the_colours_of_the_ground_at_their_places() -> None:
    rgb, seen = GroundColours()(view_at(0.0))
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


def test_cells_behind_the_only_camera_are_not_seen_and_black() -> None:
    rgb, seen = GroundColours()(view_at(0.0, rig=FRONT))
    assert seen[0, 0, BEHIND[0], BEHIND[1]] == 0
    assert (rgb[0, :, BEHIND[0], BEHIND[1]] == 0).all()
    assert ((seen >= 0) & (seen <= 1)).all()


@pytest.mark.parametrize("step_m", [0.5, 2.5])
def test_cells_that_an_earlier_frame_saw_have_its_colours(step_m: float) -> None:
    rgb, seen = drive(GroundColours(), step_m)
    assert seen[0, 0, BEHIND[0], BEHIND[1]] == 1
    torch.testing.assert_close(colour_behind(rgb), torch.tensor(PAINT), rtol=0, atol=0.1)
    beside = GRID.cell_of([-2.0, LINE_Y_M + 0.8])
    asphalt = rgb[0, ::CELL_PARTS, beside[0], beside[1]]
    torch.testing.assert_close(asphalt, torch.tensor(ASPHALT), rtol=0, atol=0.1)


def test_cells_that_are_seen_keep_their_colours() -> None:
    colours = GroundColours()
    colours(view_at(0.0, 0.0, paint=OTHER_PAINT))
    now, _ = colours(view_at(3.0, 0.6))
    alone, seen = GroundColours()(view_at(3.0))
    whole = (seen == 1).expand_as(now)
    torch.testing.assert_close(now[whole], alone[whole], rtol=0, atol=0)


def test_the_latest_frame_that_saw_a_cell_counts() -> None:
    colours = GroundColours()
    colours(view_at(0.0, 0.0, FRONT))
    colours(view_at(2.5, 0.5, FRONT, OTHER_PAINT))
    rgb, _ = colours(view_at(10.0, 2.0, FRONT))
    torch.testing.assert_close(colour_behind(rgb), torch.tensor(OTHER_PAINT), rtol=0, atol=0.1)


def test_another_drive_knows_nothing_of_the_one_before() -> None:
    first = GroundColours()(view_at(10.0, 2.0, FRONT))
    for x_m, seconds in ((10.0, 60.0), (10.0, -1.0), (900.0, 2.5)):  # a break, back in time, a jump of the pose
        colours = GroundColours()
        drive(colours)
        assert all(torch.equal(a, b) for a, b in zip(first, colours(view_at(x_m, seconds, FRONT)), strict=True))
    colours.reset()
    assert all(torch.equal(a, b) for a, b in zip(first, colours(view_at(10.0, 3.0, FRONT)), strict=True))


def test_an_ego_that_waits_remembers_the_ground_it_has_passed() -> None:
    colours = GroundColours()
    drive(colours)
    for seconds in np.arange(2.1, 6.0, 0.1):
        rgb, _ = colours(view_at(10.0, seconds, FRONT))
    torch.testing.assert_close(colour_behind(rgb), torch.tensor(PAINT), rtol=0, atol=0.1)
