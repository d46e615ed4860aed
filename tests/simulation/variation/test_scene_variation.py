"""Varied scenes: the same streets seen by other cameras, in other colours."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from made_truth_town import box_mesh, made_ground

from appocc.bevmap import LANE, ROAD, BEVMap, bev_path
from appocc.checks import ByteArray
from appocc.geometry import apply, inverse
from appocc.nuscenes import Dataset
from appocc.nuscenes.view_targets import ViewClass, load_view_targets
from appocc.nuscenes.writer import Writer
from appocc.rigs import read_rig
from appocc.simulation.mesh import Material, Mesh, join_meshes
from appocc.simulation.recording import (
    RecordingSettings,
    TownSimulation,
    build_town_simulation,
    record_scene,
    write_map,
)
from appocc.simulation.rendering.look import Look
from appocc.simulation.rendering.noise import noise_tile
from appocc.simulation.rendering.weather import WEATHERS
from appocc.simulation.scenario import draw_scenario
from appocc.simulation.sources import TownSource
from appocc.simulation.surface import Surface
from appocc.simulation.variation.light import vary_weather
from appocc.simulation.variation.materials import draw_look
from appocc.simulation.variation.scene import SceneVariation, draw_variation

TOWN = "fernport"
# A scene of this seed varies everything.
SEED = 3


def variations(count: int) -> list[SceneVariation]:
    return [draw_variation(read_rig("paper"), WEATHERS["clear"], [SEED, number, 4]) for number in range(count)]


def test_some_scenes_keep_rig_materials_and_light() -> None:
    drawn = variations(200)
    rig, weather = read_rig("paper"), WEATHERS["clear"]
    assert np.mean([scene.rig == rig for scene in drawn]) == pytest.approx(1 / 3, abs=0.09)
    assert np.mean([scene.look is None for scene in drawn]) == pytest.approx(0.2, abs=0.08)
    assert np.mean([scene.weather == weather for scene in drawn]) == pytest.approx(0.2, abs=0.08)


def test_a_scene_is_not_varied_by_default() -> None:
    scene = SceneVariation(read_rig("paper"), WEATHERS["clear"])
    assert scene.look is None
    assert scene.rare_paints == 0


@pytest.mark.parametrize("name", WEATHERS)
def test_light_varies_and_stays_light(name: str) -> None:
    drawn = [vary_weather(WEATHERS[name], np.random.default_rng(seed)) for seed in range(100)]
    for weather in drawn:
        assert weather.name == name
        assert (weather.sun_elevation_rad > 0) == (WEATHERS[name].sun_elevation_rad > 0)
        assert 0 <= weather.cloudiness <= 1
        assert (weather.sun == (0, 0, 0)) == (WEATHERS[name].sun == (0, 0, 0))
        assert max(weather.white) / min(weather.white) < 1.2 * max(WEATHERS[name].white) / min(WEATHERS[name].white)
    brightness = np.log([weather.zenith[1] for weather in drawn])
    assert 0.2 < brightness.std() < 0.5


def looks(count: int) -> Iterable[Look]:
    return (draw_look(np.random.default_rng(seed)) for seed in range(count))


def test_the_ground_changes_its_colours_and_keeps_its_labels() -> None:
    ground, tile = made_ground(), noise_tile(0)
    means = []
    for look in looks(12):
        changed = look.recolour_ground(ground, tile)
        assert changed.label is ground.label
        assert not changed.colour.flags.writeable
        road, line = (changed.colour[ground.label == s].mean() for s in (Surface.ROAD, Surface.LINE_WHITE))
        assert line > road + 30, "markings stay visible"
        means.append([road, line])
    assert np.ptp(means, axis=0)[0] > 30


def test_buildings_and_plants_change_their_tint_and_signs_do_not() -> None:
    parts: dict[Material, ViewClass] = {
        Material.BRICK: ViewClass.BUILDING,
        Material.FOLIAGE: ViewClass.VEGETATION,
        Material.BARK: ViewClass.VEGETATION,
        Material.SIGN: ViewClass.POLE_OR_SIGN,
    }
    boxes = [box_mesh((5.0 * i, 0, 1), (1, 1, 2), material=m) for i, m in enumerate(parts)]
    scenery: Mesh = join_meshes(boxes)
    kind = np.repeat(np.array(list(parts.values()), np.uint8), len(boxes[0].faces))
    for look in looks(6):
        tint: ByteArray = look.recolour_scenery(scenery, kind)
        signs = scenery.material == Material.SIGN
        np.testing.assert_array_equal(tint[signs], scenery.tint[signs])
        for material in list(parts)[:3]:
            own = scenery.material == material
            assert (tint[own] != scenery.tint[own]).any()


@dataclass(frozen=True)
class Recorded:
    """Two recordings of a scene."""

    plain: Dataset
    varied: Dataset


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    """Record the same scene as it is, varied, and as it is again, with one renderer."""
    folder = tmp_path_factory.mktemp("variation")
    simulation = build_town_simulation(TownSource(TOWN), folder)
    roots = [record(simulation, folder / name, vary=name == "varied") for name in ("plain", "varied", "again")]
    for path in sorted((roots[0] / "samples").rglob("*.jpg")):
        assert path.read_bytes() == (roots[2] / path.relative_to(roots[0])).read_bytes(), "materials are reset"
    return Recorded(Dataset(roots[0]), Dataset(roots[1]))


def record(simulation: TownSimulation, root: Path, vary: bool) -> Path:
    scenario = draw_scenario(0, TOWN, simulation.log, 0.5, ("clear",), SEED)
    writer = Writer(root, "v1.0-simulation")
    settings = RecordingSettings(2, 2.0, read_rig("paper"), lidar=False, full_maps=True, vary=vary)
    record_scene(scenario, simulation, settings, writer, lambda frames: None)
    write_map(simulation.town, TOWN, root)
    writer.save()
    return root


def test_streets_stay_and_colours_change(recorded: Recorded) -> None:
    for one, two in zip(*(data.samples(data.scenes[0]) for data in (recorded.plain, recorded.varied)), strict=True):
        maps = [
            BEVMap.load(bev_path(data.root, "exact", sample.token))
            for data, sample in ((recorded.plain, one), (recorded.varied, two))
        ]
        np.testing.assert_array_equal(recorded.plain.world_from_ego(one), recorded.varied.world_from_ego(two))
        for layer in (ROAD, LANE):
            np.testing.assert_array_equal(maps[0].occupancy[layer], maps[1].occupancy[layer])
        assert np.abs(maps[0].appearance.astype(int) - maps[1].appearance).mean() > 10


def test_the_tables_hold_the_cameras_of_the_scene(recorded: Recorded) -> None:
    plain, varied = (data.frame(data.samples(data.scenes[0])[0]).rig for data in (recorded.plain, recorded.varied))
    assert plain.channels == varied.channels
    for camera in varied:
        assert abs(camera.intrinsic[0, 0] / plain[camera.channel].intrinsic[0, 0] - 1) > 0.02
        assert np.abs(camera.ego_from_cam - plain[camera.channel].ego_from_cam).max() > 0.03


def test_vehicles_in_the_pictures_are_in_their_boxes_under_the_cameras_of_the_scene(recorded: Recorded) -> None:
    data, inside = recorded.varied, []
    for sample in data.samples(data.scenes[0]):
        frame = data.frame(sample)
        assert frame.boxes_ego is not None
        vehicles = frame.boxes_ego.vehicles()
        views = load_view_targets(data.root / "views_full" / f"{sample.token}.npz")
        for camera in frame.rig:
            view = views[camera.channel]
            assert view.depth_m is not None
            row, column = np.nonzero((view.kind == ViewClass.VEHICLE) & (view.depth_m < 40))
            rays = np.stack([column, row, np.ones(len(row))], axis=1) @ np.linalg.inv(camera.intrinsic).T
            points = apply(camera.ego_from_cam, np.asarray(rays * view.depth_m[row, column, None], np.float64))
            found = np.zeros(len(points), np.bool_)
            for i in range(len(vehicles)):
                local = apply(inverse(vehicles.frame_from_box(i)), points)
                # Mirrors and the depth's rounding to 16 bits are beyond the box.
                found |= (np.abs(local) <= vehicles.size_wlh_m[i, [1, 0, 2]] / 2 + 0.25).all(axis=1)
            inside.append(found)
    assert len(np.concatenate(inside)) > 1000
    assert np.concatenate(inside).mean() > 0.99
