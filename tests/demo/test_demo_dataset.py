from __future__ import annotations

import hashlib
from pathlib import Path

import cv2
import numpy as np
import pytest

from appocc.bevmap import LANE, ROAD, VEHICLE, BEVMap, bev_path
from appocc.checks import BoolArray, FloatArray
from appocc.demo.dataset import SCENE, Settings, write_dataset
from appocc.demo.pictures import overview
from appocc.demo.scene import VEHICLES, street_from_ego
from appocc.demo.street import CROSS_X_M, KERB_Y_M, LANE_M, WORLD_FROM_STREET
from appocc.demo.vehicles import Vehicle
from appocc.geometry import apply, inverse
from appocc.grid import BEVGrid
from appocc.groundtruth.compose import Settings as MapSettings
from appocc.groundtruth.pipeline import generate
from appocc.nuscenes import Dataset
from appocc.nuscenes.maps import mask_window
from appocc.nuscenes.validate import validate

SMALL = Settings(samples=3, width_px=264, columns=360)
LAST = SMALL.samples - 1
LAST_S = LAST * 0.5


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    """Three key frames with their maps."""
    root = tmp_path_factory.mktemp("demo") / "dataset"
    steps: list[int] = []
    write_dataset(root, SMALL, steps.append)
    assert steps == [1, 1, 1]
    made = Dataset(root)
    generate(made, made.scenes, root, MapSettings(BEVGrid.surround(), "robust"), 1, lambda _: None)
    return made


@pytest.fixture(scope="module")
def bev(dataset: Dataset) -> BEVMap:
    sample = dataset.samples(dataset.scene(SCENE))[LAST]
    return BEVMap.load(bev_path(dataset.root, "groundtruth", sample.token))


def in_box(bev: BEVMap, vehicle: Vehicle, part: float = 1.0) -> BoolArray:
    """Cells whose centres lie in a vehicle, by the scene's own numbers; `part` shrinks it about its middle."""
    vehicle_from_ego = inverse(vehicle.street_from_vehicle(LAST_S)) @ street_from_ego(LAST_S)
    local = apply(vehicle_from_ego, np.pad(bev.grid.centres(), ((0, 0), (0, 0), (0, 1))))[..., :2]
    length, width, _ = vehicle.size_lwh_m
    return np.asarray((np.abs(local) <= np.array([length, width]) / 2 * part).all(axis=-1))


def in_ego(x_m: float, y_m: float) -> FloatArray:
    """A point of the street in the ego frame of the last key frame."""
    return apply(inverse(street_from_ego(LAST_S)), np.array([x_m, y_m, 0.0]))[:2]


def digests(root: Path) -> dict[str, str]:
    files = (path for path in root.rglob("*") if path.is_file())
    return {str(path.relative_to(root)): hashlib.md5(path.read_bytes()).hexdigest() for path in files}


def test_the_same_seed_gives_the_same_bytes(tmp_path: Path) -> None:
    for name, seed in (("one", 5), ("two", 5), ("other", 6)):
        write_dataset(tmp_path / name, Settings(samples=1, width_px=64, columns=30, seed=seed), lambda _: None)
    one, two, other = (digests(tmp_path / name) for name in ("one", "two", "other"))
    assert one == two
    assert one.keys() == other.keys()
    same = {name for name in one if one[name] == other[name]}
    assert not any(name.startswith("samples/") for name in same), "pictures and sweeps depend on the seed"
    assert "maps/expansion/plain-geometry-street.json" in same


def test_the_dataset_is_healthy(dataset: Dataset) -> None:
    assert validate(dataset) == ()
    scene = dataset.scene(SCENE)
    assert "synthetic" in scene.description
    assert len(dataset.samples(scene)) == 3
    times = np.array([data.timestamp_us for data in dataset.chain(scene, "LIDAR_TOP")])
    assert len(times) == 11
    assert (np.diff(times) == 100_000).all()
    assert (dataset.world_from_ego(dataset.samples(scene)[0])[:2, 3] > 0).all()


def test_the_rig_is_that_of_the_paper(dataset: Dataset) -> None:
    frame = dataset.frame(dataset.samples(dataset.scene(SCENE))[0])
    seen = {}
    for camera in frame.rig:
        ahead = camera.ego_from_cam[:3, 2]
        yaw = np.degrees(np.arctan2(ahead[1], ahead[0]))
        fov = 2 * np.degrees(np.arctan(camera.width_px / 2 / camera.intrinsic[0, 0]))
        seen[camera.channel] = (round(float(yaw)) % 360, round(float(fov)))
        assert camera.ego_from_cam[2, 1] == pytest.approx(-1), "y of a camera points down"
    assert seen == {
        "CAM_FRONT_LEFT": (55, 70),
        "CAM_FRONT": (0, 70),
        "CAM_FRONT_RIGHT": (305, 70),
        "CAM_BACK_LEFT": (110, 70),
        "CAM_BACK": (180, 110),
        "CAM_BACK_RIGHT": (250, 70),
    }


def test_annotations_are_the_vehicles(dataset: Dataset) -> None:
    sample = dataset.samples(dataset.scene(SCENE))[LAST]
    boxes = dataset.boxes_world(sample)
    for i, vehicle in enumerate(VEHICLES):
        pose = WORLD_FROM_STREET @ vehicle.street_from_vehicle(LAST_S)
        assert boxes.centre_m[i, :2] == pytest.approx(pose[:2, 3])
        assert boxes.frame_from_box(i)[:3, :3] == pytest.approx(pose[:3, :3])
        assert boxes.centre_m[i, 2] * 2 == pytest.approx(boxes.size_wlh_m[i, 2])
        assert np.hypot(*boxes.velocity_mps[i]) == pytest.approx(vehicle.speed_mps)
    near = np.linalg.norm(boxes.centre_m - dataset.world_from_ego(sample)[:3, 3], axis=1) < 20
    assert near.sum() >= 5
    assert boxes.lidar_points[near].min() > 20


def test_lidar_and_boxes_agree(dataset: Dataset) -> None:
    """What stands up from the street between its kerbs lies in the boxes."""
    sample = dataset.samples(dataset.scene(SCENE))[LAST]
    lidar = dataset.data(sample)["LIDAR_TOP"]
    world = apply(dataset.world_from_ego_at(lidar) @ dataset.ego_from_sensor(lidar), dataset.lidar(lidar)[:, :3])
    street = apply(inverse(WORLD_FROM_STREET), world)
    upright = (street[:, 2] > 0.1) & (np.abs(street[:, 1]) < KERB_Y_M)
    assert upright.sum() > 300
    assert dataset.boxes_world(sample).inside(world[upright], margin_m=0.06).all()


def test_vehicle_layer_against_the_vehicles_themselves(bev: BEVMap) -> None:
    fine = BEVGrid(cell_m=0.1)
    blank = np.zeros((3, *fine.shape), np.float32)
    finer = BEVMap(fine, blank, blank > 0, blank.astype(np.uint8), blank[0] > 0)
    covered = np.any([in_box(finer, vehicle) for vehicle in VEHICLES], axis=0)
    x, y = bev.grid.shape
    truth = covered.reshape(x, 4, y, 4).mean(axis=(1, 3)) >= 0.5
    layer = bev.occupancy[VEHICLE] > 0.5
    assert truth.sum() > 400
    assert (truth & layer).sum() / (truth | layer).sum() > 0.95


@pytest.mark.parametrize("vehicle", VEHICLES, ids=lambda vehicle: vehicle.name)
def test_vehicles_have_about_their_true_paint(bev: BEVMap, vehicle: Vehicle) -> None:
    cells = in_box(bev, vehicle, 0.8) & bev.appearance_valid
    assert cells.sum() >= 10
    seen = np.median(bev.appearance[:, cells], axis=1)
    # The light takes up to a fifth from a face that is turned away from the sun, and adds next to nothing; of what
    # is far, these small pictures have few pixels that show nothing else.
    paint = np.array(vehicle.paint)
    slack = 8 if np.hypot(*bev.grid.centres()[cells].mean(axis=0)) < 20 else 28
    assert (seen >= 0.78 * paint - slack).all()
    assert (seen <= 1.04 * paint + slack).all()


def test_red_is_left_in_the_cameras_and_in_the_map(dataset: Dataset, bev: BEVMap) -> None:
    frame = dataset.frame(dataset.samples(dataset.scene(SCENE))[LAST])

    def redness(rgb: FloatArray) -> BoolArray:
        return np.asarray((rgb[..., 0] > 100) & (rgb[..., 1] < 60) & (rgb[..., 2] < 60))

    red = redness(np.moveaxis(bev.appearance, 0, -1).astype(np.float64)) & (bev.occupancy[VEHICLE] > 0.5)
    assert red.sum() > 30
    places = bev.grid.centres()[red]
    assert (places[:, 1] > 3).all()
    assert places.mean(axis=0) == pytest.approx(in_ego(79.5, 4.75), abs=0.3)
    counts = {channel: int(redness(image.astype(np.float64)).sum()) for channel, image in frame.images.items()}
    assert counts["CAM_FRONT_LEFT"] > 300 > 30 > counts["CAM_FRONT_RIGHT"]
    columns = np.flatnonzero(redness(frame.images["CAM_FRONT"].astype(np.float64)).sum(axis=0) > 15)
    assert len(columns)
    assert columns.max() < frame.rig["CAM_FRONT"].width_px / 2


def test_road_and_lane_come_from_the_vector_map(bev: BEVMap) -> None:
    assert {bev.meta["sources"][name] for name in ("road", "lane")} == {"map_expansion"}
    for place, layers in (
        ((80.0, -1.0), [True, False]),
        ((50.0, -LANE_M), [True, True]),
        ((80.0, -KERB_Y_M - 1), [False, False]),
        ((49.5, 0.0), [True, True]),
        ((52.5, 0.0), [True, False]),
        ((CROSS_X_M - 1, 20.0), [True, False]),
        ((CROSS_X_M - 6.3, -LANE_M / 2), [True, True]),
    ):
        i, j = bev.grid.cell_of(in_ego(*place))
        assert (bev.occupancy[[ROAD, LANE], i, j] > 0.5).tolist() == layers, place


def test_colours_of_the_ground_lie_where_the_map_has_them(bev: BEVMap) -> None:
    free = bev.appearance_valid & (bev.occupancy[VEHICLE] < 0.5)
    x, y = np.moveaxis(bev.grid.centres(), -1, 0)
    near = free & (np.abs(x) < 15)
    on_line = near & (bev.occupancy[LANE] > 0.5) & (np.abs(y) > 1.8)
    on_road = near & (bev.occupancy[LANE] < 0.5) & (np.abs(y) < 1)
    grass = near & (y < -8.5) & (y > -12)
    line_rgb, road_rgb, grass_rgb = (
        np.median(bev.appearance[:, cells], axis=1) for cells in (on_line, on_road, grass)
    )
    assert line_rgb.min() > road_rgb.max() + 20
    assert np.ptp(road_rgb) < 15
    assert grass_rgb.argmax() == 1


def test_mask_agrees_with_the_vector_map(dataset: Dataset, bev: BEVMap) -> None:
    sample = dataset.samples(dataset.scene(SCENE))[LAST]
    pose = dataset.world_from_ego(sample)
    low, high = pose[:2, 3] - 60, pose[:2, 3] + 60
    mask = mask_window(dataset, dataset.scene(SCENE), low, high)
    assert mask is not None
    centres = np.pad(bev.grid.centres(), ((0, 0), (0, 0), (0, 1)))
    drivable, known = mask.sample(apply(pose, centres)[..., :2])
    road = bev.occupancy[ROAD] > 0.5
    assert known.all()
    assert (drivable & road).sum() / (drivable | road).sum() > 0.97


def test_devkit_opens_it(dataset: Dataset) -> None:
    nuscenes = pytest.importorskip("nuscenes", reason="nuscenes-devkit is not installed")
    kit = nuscenes.NuScenes("v1.0-demo", str(dataset.root), verbose=False)
    sample = kit.get("sample", kit.scene[0]["first_sample_token"])
    _, boxes, _ = kit.get_sample_data(sample["data"]["CAM_FRONT"])
    assert {"vehicle.car"} <= {box.name for box in boxes}


def test_overview_shows_left_on_the_left(dataset: Dataset, bev: BEVMap) -> None:
    frame = dataset.frame(dataset.samples(dataset.scene(SCENE))[LAST])
    picture = overview(frame, bev)
    upper = picture[: picture.shape[0] - 800]
    reference = cv2.resize(frame.images["CAM_FRONT_LEFT"], (100, 56), interpolation=cv2.INTER_AREA).astype(int)
    third = cv2.resize(upper[: upper.shape[0] // 2, : upper.shape[1] // 3], (100, 56), interpolation=cv2.INTER_AREA)
    assert np.abs(third.astype(int) - reference).mean() < 8
    colour = picture[-800:, :800]
    i, j = bev.grid.cell_of(in_ego(79.5, 4.75))
    red = colour[(199 - i) * 4 + 1, (199 - j) * 4 + 1]
    assert red.tolist() == bev.appearance[:, i, j].tolist()
    assert (199 - j) * 4 < 400
