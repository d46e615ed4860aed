"""The numbers of docs/conventions.md are those of the code: every row of its tables is read and tried."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from appocc import geometry as g
from appocc.bevmap import CLASSES, BEVMap
from appocc.boxes import Boxes, is_vehicle
from appocc.camera import Camera
from appocc.checks import FloatArray
from appocc.grid import BEVGrid
from appocc.nuscenes.lidar import write_lidar
from appocc.rasterise import LANE_SHARE, ROAD_SHARE, VEHICLE_SHARE
from appocc.visualization.canvas import BEVCanvas, to_image_axes

PAGE = Path(__file__).parents[1] / "docs" / "conventions.md"
QUARTER = g.quaternion_from_yaw(np.pi / 2)
SURROUND, FRONT = BEVGrid.surround(), BEVGrid.front()
K = np.array([[1000.0, 0, 799.5], [0, 1000.0, 449.5], [0, 0, 1]])


def rows(heading: str) -> list[list[str]]:
    """The rows of the table below a heading of the page, without its head."""
    lines = PAGE.read_text().split(f"## {heading}\n")[1].split("\n## ")[0].splitlines()
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines if line.startswith("|")]
    return cells[2:]


def _camera() -> Camera:
    return Camera("CAM_FRONT", 1600, 900, K.copy(), g.transform([0.5, -0.5, 0.5, -0.5], [1.5, 0.0, 1.6]))


def _seen(point: FloatArray) -> list[float]:
    uv, depth = _camera().project_ego(point[None])
    return [*uv[0], *depth]


def _intrinsic(camera: Camera) -> list[float]:
    k = camera.intrinsic
    return [k[0, 0], k[1, 1], k[0, 2], k[1, 2]]


def _models_camera() -> list[float]:
    camera = _camera().resized(352, 198).cropped(0, 48, 352, 198 - 48 - 22)
    return [*_intrinsic(camera), camera.width_px, camera.height_px]


def _corner() -> FloatArray:
    zero3, size = np.zeros((1, 3)), np.array([[2.0, 4.0, 1.6]])
    box = Boxes(
        centre_m=zero3,
        size_wlh_m=size,
        rotation=np.eye(3)[None],
        category=("car",),
        instance=("",),
        token=("",),
        velocity_mps=np.zeros((1, 2)),
        lidar_points=np.zeros(1, np.int64),
    )
    return np.asarray(box.corners()[0, 0])


def _cell_of_pixel(column_row: FloatArray) -> list[int]:
    numbers = np.arange(200, dtype=np.uint8)
    column, row = column_row.astype(int)
    return [int(to_image_axes(layer)[row, column]) for layer in np.meshgrid(numbers, numbers, indexing="ij")]


# What each row of the golden table means in code: a function of the numbers under "Given".
GOLDEN: dict[str, Callable[[FloatArray], object]] = {
    "yaw of a quaternion wxyz": lambda x: g.yaw_of(g.rotation_from_quaternion(x)),
    "quaternion wxyz of a yaw": lambda x: g.quaternion_from_yaw(float(x[0])),
    "point turned by a quarter to the left": lambda x: g.rotation_from_quaternion(QUARTER) @ x,
    "angle wrapped to [-pi, pi)": lambda x: g.wrap_angle(x),
    "world point of an ego point, ego at (100, 200, 0) with yaw 90 deg": lambda x: g.apply(
        g.transform(QUARTER, [100, 200, 0]), x
    ),
    "pixel and depth in the forward camera of an ego point": _seen,
    "K (fx fy cx cy) of a 1600x900 picture, 1000 1000 799.5 449.5, at 352x198": lambda x: _intrinsic(
        _camera().resized(352, 198)
    ),
    "the same after 48 rows above and 22 below are cut, and its size": lambda x: _models_camera(),
    "front left lower corner of a box 2 wide, 4 long, 1.6 high at the origin": lambda x: _corner(),
    "shape of the 360 grid": lambda x: SURROUND.shape,
    "shape of the 180 grid": lambda x: FRONT.shape,
    "cell of a point, 360 grid": SURROUND.cell_of,
    "cell of a point, 180 grid": FRONT.cell_of,
    "centre of a cell, 360 grid": SURROUND.centre_of,
    "centre of a cell, 180 grid": FRONT.centre_of,
    "cell of the upper left pixel of a picture, 360 grid": _cell_of_pixel,
    "pixel (column, row) of an ego point, 360 grid, 4 pixels a cell": BEVCanvas(SURROUND, scale=4).pixel,
    "is a vehicle: vehicle.motorcycle": lambda x: is_vehicle("vehicle.motorcycle"),
    "is a vehicle: vehicle.bicycle": lambda x: is_vehicle("vehicle.bicycle"),
    "is a vehicle: human.pedestrian.adult": lambda x: is_vehicle("human.pedestrian.adult"),
}


def numbers(text: str) -> FloatArray:
    return np.array([float(part) for part in text.split()])


@pytest.mark.parametrize(("name", "given", "result"), rows("Golden numbers"))
def test_golden_numbers(name: str, given: str, result: str) -> None:
    found = np.asarray(GOLDEN[name](numbers(given)), dtype=np.float64)
    np.testing.assert_allclose(np.atleast_1d(found), numbers(result), atol=2e-8)


def test_every_golden_number_is_on_the_page() -> None:
    assert {row[0] for row in rows("Golden numbers")} == set(GOLDEN)


def test_a_lidar_point_is_20_bytes(tmp_path: Path) -> None:
    write_lidar(tmp_path / "a.bin", np.zeros((3, 5)))
    assert (tmp_path / "a.bin").stat().st_size == 3 * 20


@pytest.mark.parametrize(("setting", "x", "y", "cell", "shape"), rows("Grid"))
def test_grids(setting: str, x: str, y: str, cell: str, shape: str) -> None:
    grid = {"360": SURROUND, "180": FRONT}[setting.split()[0]]
    limits = [numbers(text.strip("[) m").replace(",", " ")) for text in (x, y)]
    np.testing.assert_array_equal(grid.as_array(), [*limits[0], *limits[1], float(cell.split()[0])])
    assert str(grid.shape) == shape


def test_classes() -> None:
    shares = {"road": ROAD_SHARE, "vehicle": VEHICLE_SHARE, "lane": LANE_SHARE}
    for layer, name, cover, _ in rows("Classes"):
        assert CLASSES[int(layer)] == name
        assert shares[name] == float(cover.split()[0]) / 100
    assert len(rows("Classes")) == len(CLASSES)


def test_bev_files(tmp_path: Path) -> None:
    x, y = SURROUND.shape
    known, dark = np.ones((3, x, y), np.bool_), np.zeros((3, x, y), np.uint8)
    BEVMap(SURROUND, np.zeros((3, x, y), np.float32), known, dark, known[0]).save(tmp_path / "a.npz")
    with np.load(tmp_path / "a.npz") as data:
        kinds = {key: "str" if data[key].dtype.kind == "U" else data[key].dtype.name for key in data.files}
        stored = {key: (kinds[key], data[key].shape) for key in data.files}
    named = {"(3, X, Y)": (3, x, y), "(X, Y)": (x, y), "(5,)": (5,), "()": ()}
    expected = {key: (kind, named[shape]) for key, kind, shape, _ in rows("BEV files")}
    assert stored == expected
