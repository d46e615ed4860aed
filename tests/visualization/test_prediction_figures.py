"""Figures of maps: cameras as one looks out, vehicles in their paint, labels that do not cover each other."""

from __future__ import annotations

import numpy as np
import pytest

from appocc.bevmap import BEVMap
from appocc.boxes import Boxes
from appocc.camera import Camera, CameraRig
from appocc.checks import ByteArray, FloatArray
from appocc.ego_vehicle import EgoVehicle
from appocc.grid import BEVGrid
from appocc.objects import BEVObjects
from appocc.visualization.cameras import camera_sheet
from appocc.visualization.labels import LabelPlacer
from appocc.visualization.layout import resized, side_by_side, stack_centred
from appocc.visualization.predictions import map_panel
from appocc.visualization.vehicle_marks import VehicleMarks

GRID, CAPTION_PX = BEVGrid.surround(), 26
PAINT = (250, 20, 240)


def looking(channel: str, yaw_deg: float, size_px: tuple[int, int] = (160, 90)) -> Camera:
    cos, sin = np.cos(np.radians(yaw_deg)), np.sin(np.radians(yaw_deg))
    pose = np.eye(4)
    pose[:3, :3] = np.array([[sin, 0, cos], [-cos, 0, sin], [0, -1, 0]])
    return Camera(channel, *size_px, np.array([[100.0, 0, 79.5], [0, 100, 44.5], [0, 0, 1]]), pose)


def sheet_of(yaws_deg: list[float], width_px: int = 900) -> tuple[ByteArray, dict[float, FloatArray]]:
    """The sheet of cameras, each with one grey of its own, and the (row, column) of the middle of each."""
    cameras = tuple(looking(f"CAMERA_{number}", yaw) for number, yaw in enumerate(yaws_deg))
    greys = {c.channel: 40 + 20 * number for number, c in enumerate(cameras)}
    images = {c.channel: np.full((c.height_px, c.width_px, 3), greys[c.channel], np.uint8) for c in cameras}
    sheet = camera_sheet(images, CameraRig(cameras), width_px)
    grey = {yaw: greys[c.channel] for yaw, c in zip(yaws_deg, cameras, strict=True)}
    return sheet, {yaw: np.argwhere((sheet == value).all(axis=-1)).mean(axis=0) for yaw, value in grey.items()}


def test_three_look_ahead_over_three_behind_in_any_order() -> None:
    sheet, place = sheet_of([-110, 0, 180, 55, 110, -55])
    assert sheet.shape == (2 * 169, 900, 3)
    for front, rear in ((55, 110), (0, 180), (-55, -110)):
        assert place[rear] - place[front] == pytest.approx([169, 0], abs=2)
    assert place[55][1] < place[0][1] < place[-55][1]


@pytest.mark.parametrize(
    "yaws",
    [
        [0],
        [180],
        [0, 180],
        [50, 0, -50],
        [0, 90, 180, -90],
        [0, 60, -60, 120, -120],
        [0, 45, -45, 99, -99, 153, -153],
        [0, 45, 90, 135, 180, -135, -90, -45],
    ],
)
def test_any_number_of_cameras_fits(yaws: list[float]) -> None:
    sheet, place = sheet_of(yaws)
    assert sheet.shape[1] <= 900
    assert sheet.shape[0] <= 2 * 300
    assert np.isfinite(list(place.values())).all()  # each is somewhere
    assert len({tuple(np.round(middle)) for middle in place.values()}) == len(yaws)
    for yaw, (_, column) in place.items():
        assert np.sign(round(sheet.shape[1] / 2 - column, -1)) == np.sign(yaw % 180 if yaw > 0 else -(-yaw % 180))


def test_a_high_image_is_not_higher_than_wide() -> None:
    camera = looking("CAMERA", 0, (100, 200))
    sheet = camera_sheet({"CAMERA": np.zeros((200, 100, 3), np.uint8)}, CameraRig((camera,)), 900)
    assert sheet.shape == (300, 150, 3)


def empty_map() -> BEVMap:
    shape = GRID.shape
    known = np.ones((3, *shape), np.bool_)
    return BEVMap(GRID, np.zeros((3, *shape), np.float32), known, np.zeros((3, *shape), np.uint8), known[0].copy())


def marks_at(*places: tuple[float, float], paint: tuple[float, float, float] = PAINT) -> VehicleMarks:
    n = len(places)
    size = np.tile([4.5, 1.8], (n, 1))
    return VehicleMarks(
        np.array(places).reshape(-1, 2), np.zeros(n), size, np.ones(n, np.bool_), np.tile(paint, (n, 1))
    )


def panel_of(what: str, vehicles: VehicleMarks) -> ByteArray:
    return map_panel(empty_map(), what, vehicles, EgoVehicle())[CAPTION_PX:]


def test_vehicles_are_filled_with_their_paint_where_they_are() -> None:
    where = np.argwhere((panel_of("appearance", marks_at((20.0, 10.0))) == PAINT).all(axis=-1))
    assert where.mean(axis=0) == pytest.approx([200, 300], abs=6)  # 10 px a metre, the front line is white
    assert 45 * 18 / 2 < len(where) < 45 * 18  # without outline and front line
    assert not (panel_of("occupancy", marks_at((20.0, 10.0))) == PAINT).all(axis=-1).any()


def test_unknown_paint_leaves_the_cells() -> None:
    picture = panel_of("appearance", marks_at((20.0, 10.0), paint=(np.nan,) * 3))
    assert picture[215, 304].tolist() == [0, 0, 0]  # inside, beside the line to the front
    assert picture[190:210, 285:320].any()  # the outline


def test_vehicles_outside_the_map_are_left_out() -> None:
    bare = panel_of("appearance", marks_at())
    assert (panel_of("appearance", marks_at((1e6, 3.0), (0.0, -50.0))) == bare).all()


def test_labels_do_not_cover_each_other_and_the_nearest_comes_first() -> None:
    vehicles = marks_at(*((20.0 + 0.1 * k, 10.0) for k in range(12)))
    bare = panel_of("occupancy", marks_at())
    far_first = vehicles.select(np.arange(12)[::-1])
    assert (panel_of("occupancy", far_first) == panel_of("occupancy", vehicles)).all()
    labels = LabelPlacer(np.zeros((120, 200, 3), np.uint8))
    drawn = [labels.put((100, 60), "+20.0 m", (255, 255, 255), None, 20) for _ in range(6)]
    assert drawn == [True] * 4 + [False] * 2
    assert (bare != panel_of("occupancy", vehicles)).any()


def test_a_label_without_a_chip_stands_on_darkened_ground() -> None:
    picture = np.full((40, 100, 3), 240, np.uint8)
    assert LabelPlacer(picture).put((50, 20), "5 m", (255, 255, 255), None, 4)
    assert (picture == 80).all(axis=-1).sum() > 100
    assert (picture[:, :50] == 240).all()


def test_marks_of_objects_are_vehicles_with_paint() -> None:
    objects = BEVObjects(
        centre_m=np.array([[5.0, 1.0, 0.8], [9.0, 2.0, 0.9], [7.0, 0.0, 0.5]]),
        size_wlh_m=np.array([[1.8, 4.5, 1.6], [0.6, 0.5, 1.8], [2.5, 9.0, 3.0]]),
        yaw_rad=np.array([0.1, 0.2, 0.3]),
        velocity_mps=np.zeros((3, 2)),
        kind=("car", "pedestrian", "bus"),
        rgb=np.array([[1.0, 2, 3], [4, 5, 6], [7, 8, 9]]),
        score=np.ones(3),
    )
    marks = VehicleMarks.of_objects(objects)
    assert marks.length_width_m.tolist() == [[4.5, 1.8], [9.0, 2.5]]
    assert marks.yaw_rad.tolist() == [0.1, 0.3]
    assert marks.rgb.tolist() == [[1, 2, 3], [7, 8, 9]]
    assert marks.heading_known.all()
    assert len(VehicleMarks.of_boxes(Boxes.empty()).centre_m) == 0


def test_pictures_are_arranged_on_white() -> None:
    small, large = np.zeros((2, 3, 3), np.uint8), np.full((4, 5, 3), 9, np.uint8)
    row = side_by_side([small, large], gap_px=1)
    assert row.shape == (4, 9, 3)
    assert (row[2:, :4] == 255).all()
    assert (row[:, 3] == 255).all()
    assert (row[:, 4:] == 9).all()
    column = stack_centred([large, small])
    assert column.shape == (6, 5, 3)
    assert (column[4:, 1:4] == 0).all()
    assert (column[4:, [0, 4]] == 255).all()
    assert resized(large, 2).shape == (8, 10, 3)
    assert resized(large, 0.01).shape == (1, 1, 3)
