"""Pictures for people: forward is up, left is to the left, boxes and texts stay in the picture."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from appocc.bevmap import LANE, ROAD, VEHICLE, BEVMap
from appocc.boxes import Boxes
from appocc.camera import Camera
from appocc.checks import FloatArray
from appocc.ego_vehicle import EgoVehicle
from appocc.geometry import transform
from appocc.grid import BEVGrid
from appocc.visualization import canvas as d

GRID = BEVGrid(-2, 6, -4, 4, 1.0)  # 8 x 8 cells


def empty_map(**layers: tuple[int, int]) -> BEVMap:
    """A map that knows everything but holds nothing, with one cell of some layers on."""
    occupancy = np.zeros((3, 8, 8), np.float32)
    for name, cell in layers.items():
        occupancy[{"road": ROAD, "vehicle": VEHICLE, "lane": LANE}[name]][cell] = 1
    known = np.ones((3, 8, 8), np.bool_)
    return BEVMap(GRID, occupancy, known, np.zeros((3, 8, 8), np.uint8), np.zeros((8, 8), np.bool_))


def test_the_front_left_cell_is_drawn_at_the_upper_left() -> None:
    cells = np.zeros((8, 8), np.uint8)
    cells[7, 7] = 1  # farthest ahead, farthest left
    cells[7, 0] = 2  # farthest ahead, farthest right
    cells[0, 7] = 3  # behind, left
    picture = d.to_image_axes(cells)
    assert (picture[0, 0], picture[0, 7], picture[7, 0]) == (1, 2, 3)


def test_pixels_of_points_agree_with_pixels_of_cells() -> None:
    canvas = d.BEVCanvas(GRID, scale=3)
    places: tuple[tuple[float, float], ...] = ((-1.5, 3.5), (5.5, -3.5), (0.5, 0.5))
    for x, y in places:
        rgb = np.zeros((8, 8, 3), np.uint8)
        rgb[tuple(GRID.cell_of([x, y]))] = (255, 0, 0)
        canvas.cells(rgb)
        column, row = canvas.pixel([x, y])
        assert canvas.picture[row, column].tolist() == [255, 0, 0]
        assert (canvas.picture[..., 0] > 0).sum() == 9


def test_pixel_golden_numbers() -> None:
    canvas = d.BEVCanvas(BEVGrid.surround(), scale=4)
    assert canvas.picture.shape == (800, 800, 3)
    assert canvas.pixel([[39.99, 39.99], [0.0, 0.0], [-39.99, -39.99]]).tolist() == [[0, 0], [400, 400], [799, 799]]


def test_a_mask_leaves_the_rest_as_it_is() -> None:
    canvas = d.BEVCanvas(GRID, scale=2)
    where = np.zeros((8, 8), np.bool_)
    where[0, 0] = True
    canvas.cells(np.full((8, 8, 3), 9, np.uint8), where)
    assert (canvas.picture == 9).all(axis=2).sum() == 4
    assert canvas.picture[-1, -1].tolist() == [9, 9, 9]
    assert (canvas.picture[:14] == d.hatch_pattern(16, 16)[:14]).all()


def test_layers_are_told_apart_and_vehicles_lie_on_top() -> None:
    canvas = d.BEVCanvas(GRID, scale=1)
    canvas.occupancy(empty_map(road=(0, 0), lane=(1, 1), vehicle=(1, 1)))
    colours = {tuple(pixel) for row in canvas.picture for pixel in row}
    assert len(colours) == 3  # empty, road, vehicle
    assert canvas.picture[7, 7].tolist() != canvas.picture[6, 6].tolist()


def test_unknown_cells_stay_hatched_unlike_a_dark_street() -> None:
    canvas = d.BEVCanvas(GRID, scale=2)
    hatch_pattern = canvas.picture.copy()
    assert {tuple(pixel) for row in hatch_pattern.tolist() for pixel in row} == {d.UNKNOWN_COLOUR, d.HATCH_COLOUR}
    bev = empty_map()
    canvas.appearance(bev)
    assert (canvas.picture == hatch_pattern).all()
    unknown = BEVMap(GRID, bev.occupancy, np.zeros((3, 8, 8), np.bool_), bev.appearance, bev.appearance_valid)
    canvas.occupancy(unknown)
    assert (canvas.picture == hatch_pattern).all()


def test_predicted_colours_are_as_faint_as_the_network_is_unsure() -> None:
    red = np.zeros((3, 8, 8), np.uint8)
    red[0] = 250
    occupancy = np.zeros((3, 8, 8), np.float32)
    occupancy[ROAD, 7], occupancy[LANE, 6], occupancy[VEHICLE, 5] = 1.0, 0.8, 0.4
    true = BEVMap(GRID, occupancy, np.ones((3, 8, 8), np.bool_), red, np.ones((8, 8), np.bool_))
    made = replace(true, meta={"thresholds": {"road": 0.5, "vehicle": 0.5, "lane": 0.5}})
    pictures = []
    for bev in (true, made):
        canvas = d.BEVCanvas(GRID, scale=1)
        canvas.appearance(bev)
        pictures.append(canvas.picture)
    assert (pictures[0] == (250, 0, 0)).all()
    rows = pictures[1].astype(int)
    assert (rows == rows[:, :1]).all()
    certain, likely, unlikely, nothing = rows[:4, 0]
    assert certain.tolist() == [250, 0, 0]
    assert len(np.unique(rows[3:], axis=None)) == 3  # one colour, without red
    shares = [(cell - nothing)[0] / (certain - nothing)[0] for cell in (likely, unlikely)]
    assert shares == pytest.approx([0.64, 0.16], abs=0.01)


def test_a_polygon_is_filled() -> None:
    canvas = d.BEVCanvas(BEVGrid.surround(), scale=4)
    canvas.polygon([[4, 2], [-4, 2], [-4, -2], [4, -2]], d.RED)
    red = np.argwhere((canvas.picture == d.RED).all(axis=2))
    assert len(red) == pytest.approx(80 * 40, rel=0.05)
    assert red.mean(axis=0) == pytest.approx([400, 400], abs=1)


def test_lines_and_dots_are_drawn_where_they_are() -> None:
    canvas = d.BEVCanvas(BEVGrid.surround(), scale=4)
    canvas.dot([10, 5], d.RED)
    column, row = canvas.pixel([10, 5])
    assert tuple(canvas.picture[row, column]) == d.RED
    canvas.line([[-5, -5], [-5, -15]], d.YELLOW)
    column, row = canvas.pixel([-5, -10])
    assert canvas.picture[row, column].tolist() == pytest.approx(d.YELLOW, abs=30)  # its edges are smoothed


@pytest.mark.parametrize("vehicle", [EgoVehicle(), EgoVehicle(length_m=12.0, width_m=2.5, rear_overhang_m=3.0)])
def test_the_ego_vehicle_is_drawn_at_its_size(vehicle: EgoVehicle) -> None:
    canvas = d.BEVCanvas(BEVGrid.surround(), scale=4)
    before = canvas.picture.copy()
    canvas.ego(vehicle)
    rows, columns = np.nonzero((canvas.picture != before).any(axis=2))
    ahead, behind = 40 - rows.min() / 10, 40 - rows.max() / 10
    assert behind == pytest.approx(-vehicle.rear_overhang_m, abs=0.4)
    assert ahead == pytest.approx(vehicle.length_m - vehicle.rear_overhang_m, abs=0.4)
    assert 400 - columns.min() == pytest.approx(columns.max() - 400, abs=2)
    assert (columns.max() - columns.min()) / 10 == pytest.approx(vehicle.width_m, abs=0.4)


def test_labels_stay_inside_the_picture() -> None:
    for xy in ([39.9, 39.9], [-39.9, -39.9], [500.0, -500.0]):
        canvas = d.BEVCanvas(BEVGrid.surround(), scale=2)
        canvas.label(xy, "12.3 m")
        changed = np.argwhere((canvas.picture != d.BEVCanvas(canvas.grid, scale=2).picture).any(axis=2))
        assert len(changed) > 50
        assert (changed.max(axis=0) - changed.min(axis=0) > [5, 30]).all()


def _camera() -> Camera:
    intrinsic = np.array([[100.0, 0, 79.5], [0, 100.0, 59.5], [0, 0, 1]])
    return Camera("CAM_FRONT", 160, 120, intrinsic, transform([0.5, -0.5, 0.5, -0.5], [0, 0, 1.5]))


def _corners(x: float, y: float = 0.0) -> FloatArray:
    one = np.array([1]), np.eye(3)[None]
    centre, size = np.array([[x, y, 0.8]]), np.array([[2.0, 4, 1.6]])
    return np.asarray(
        Boxes(
            centre_m=centre,
            size_wlh_m=size,
            rotation=one[1],
            category=("car",),
            instance=("i",),
            token=("t",),
            velocity_mps=np.zeros((1, 2)),
            lidar_points=one[0],
        ).corners()[0]
    )


def test_a_box_ahead_is_drawn_around_its_place() -> None:
    picture = np.zeros((120, 160, 3), np.uint8)
    assert d.draw_box(picture, _camera(), _corners(12.0), d.GREEN)
    rows, columns = np.nonzero(picture.any(axis=2))
    assert columns.mean() == pytest.approx(79.5, abs=1)
    # The near face: 10 m ahead, 2 m wide, from 1.5 m below the camera to 0.1 m above it.
    assert columns.min() == pytest.approx(69.5, abs=2)
    assert rows.max() == pytest.approx(74.5, abs=2)


def test_boxes_behind_or_beside_the_picture_are_not_drawn() -> None:
    for corners in (_corners(-10.0), _corners(10.0, y=60.0)):
        picture = np.zeros((120, 160, 3), np.uint8)
        assert not d.draw_box(picture, _camera(), corners, d.GREEN)
        assert not picture.any()


def test_a_box_that_reaches_behind_the_camera_is_cut_there() -> None:
    picture = np.zeros((120, 160, 3), np.uint8)
    assert d.draw_box(picture, _camera(), _corners(1.0, y=1.5), d.GREEN)
    assert picture.any()


def test_a_preview_shows_appearance_beside_occupancy() -> None:
    bev = empty_map(road=(4, 4))
    colour = np.zeros((3, 8, 8), np.uint8)
    colour[0] = 200
    shown = BEVMap(GRID, bev.occupancy, bev.occupancy_valid, colour, np.ones((8, 8), np.bool_))
    picture = d.preview(shown, EgoVehicle(), scale=20)
    assert picture.shape == (160, 320, 3)
    assert tuple(picture[150, 10]) == (200, 0, 0)
    assert tuple(picture[150, 170]) != (200, 0, 0)


def test_lines_that_leave_the_picture_by_far_are_left_out() -> None:
    """Pixels beyond any number that OpenCV can clip: an edge that ends right beside the camera, 300 m to the side."""
    picture = np.zeros((120, 160, 3), np.uint8)
    beside = np.tile([[0.3, 300.0, 1.5]], (8, 1))
    assert not d.draw_box(picture, _camera(), beside, d.GREEN)
    assert not picture.any()


@pytest.mark.parametrize("text", ["a\0b", "caf\u00e9", "\ud800", "line\nbreak", "\u8eca", "x" * 10_000, ""])
def test_any_text_can_be_written(text: str) -> None:
    """OpenCV itself ends the process on some of these."""
    picture = np.zeros((30, 60, 3), np.uint8)
    d.put_text(picture, text, (2, 20))
    assert picture.any() == bool(text)


def test_a_long_caption_is_written_smaller_and_whole() -> None:
    short, long = (d.caption("M" * n, 400) for n in (10, 60))
    assert short.shape == long.shape == (26, 400, 3)
    inked = np.flatnonzero((long < 100).any(axis=(0, 2)))
    assert 340 < inked.max() < 399
    gaps = np.diff(inked)
    assert gaps.max() < 8  # evenly written up to its end
    heights = [np.ptp(np.flatnonzero((one < 100).any(axis=(1, 2)))) for one in (short, long)]
    assert heights[1] < heights[0]
