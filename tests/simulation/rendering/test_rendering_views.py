from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest
from made_render_town import WALL_Y_M, box, camera, car, town
from tolerances import assert_rounded

from appocc.camera import Camera, CameraRig
from appocc.checks import FloatArray
from appocc.geometry import apply, inverse, quaternion_from_yaw, transform
from appocc.nuscenes.view_targets import ViewClass
from appocc.simulation.mesh import Material, Mesh, join_meshes
from appocc.simulation.rendering import renderer as module
from appocc.simulation.rendering.embree import PacketScene, SingleRayScene, build_scene
from appocc.simulation.rendering.renderer import Renderer
from appocc.simulation.rendering.views import CameraView
from appocc.simulation.rendering.weather import WEATHERS

POSE = transform(quaternion_from_yaw(0.2), [8.0, -1.5, 0.0])
RIG = CameraRig((camera("A", 160, 60, (1.5, 0.2, 1.5), 0), camera("B", 120, 80, (1.0, 0.4, 1.6), 70)))
TERMS = 4 * 9  # of where a ray meets a triangle: products of three vectors
NO_BYTES = np.zeros(0, np.uint8)
CARS = join_meshes([car(20, -2, 3), car(16, 6, 1, (240, 240, 240))])


@pytest.fixture(scope="module")
def renderer() -> Renderer:
    return Renderer(town())


def views(renderer: Renderer, rig: CameraRig = RIG, seed: int = 0, mesh: Mesh = CARS) -> Mapping[str, CameraView]:
    renderer.set_scene(mesh, np.zeros(4, np.uint8), NO_BYTES, WEATHERS["clear"], None)
    return renderer.views(rig, POSE, np.random.default_rng(seed))


def points_of(view: CameraView, by: Camera) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Points (N, 3) in the town, pixels (N, 2) and depths (N,) of all pixels that are not sky, from the depth map."""
    rows, columns = np.nonzero(np.isfinite(view.depth_m))
    pixels = np.stack([columns, rows], 1).astype(np.float64)
    depth = view.depth_m[rows, columns].astype(np.float64)
    in_cam: FloatArray = (
        np.column_stack([pixels, np.ones(len(pixels))]) @ np.linalg.inv(by.intrinsic).T * depth[:, None]
    )
    return apply(POSE @ by.ego_from_cam, in_cam), pixels, depth


def test_depth_maps_pixels_to_surfaces(renderer: Renderer) -> None:
    for channel, view in views(renderer).items():
        points, _, _ = points_of(view, RIG[channel])
        kind = view.kind[np.isfinite(view.depth_m)]
        ground = np.isin(kind, [ViewClass.ROAD, ViewClass.LANE_MARKING, ViewClass.TERRAIN])
        assert np.abs(points[ground, 2]).max() < 2e-3
        wall = kind == ViewClass.BUILDING
        on_a_face = [np.abs(points[wall, 1] - WALL_Y_M), np.abs(points[wall, 0] - 5), np.abs(points[wall, 0] - 35)]
        assert np.min(on_a_face, axis=0).max() < 5e-3


def test_a_known_point_is_seen_where_it_is_projected(renderer: Renderer) -> None:
    # The upright edge of the red car's body that is its outline in the picture, and a place on its back, below lamps.
    fine = RIG["A"].resized(1600, 600)
    uv, depth = fine.project_ego(apply(inverse(POSE), np.array([[22.0, -1.1, 0.45], [18.0, -2.0, 0.45]])))
    view = views(renderer, CameraRig((fine,)))["A"]
    edge = np.flatnonzero(view.actor[round(float(uv[0, 1]))] == 3).min()
    assert 0 <= edge - uv[0, 0] < 1.0  # a tenth of a pixel of the small picture
    column, row = np.rint(uv[1]).astype(int)
    assert view.actor[row, column] == 3
    assert view.depth_m[row, column] == pytest.approx(depth[1], abs=5e-3)


def test_pixel_classes(renderer: Renderer) -> None:
    view = views(renderer)["A"]
    assert (view.actor >= 0).any()
    np.testing.assert_array_equal(view.kind[view.actor >= 0], ViewClass.VEHICLE)
    assert set(np.unique(view.actor)) == {-1, 1, 3}
    sky = view.kind == ViewClass.SKY
    np.testing.assert_array_equal(np.isinf(view.depth_m), sky)
    points, pixels, _ = points_of(view, RIG["A"])
    kind = view.kind[pixels[:, 1].astype(int), pixels[:, 0].astype(int)]
    line = kind == ViewClass.LANE_MARKING
    assert line.any()
    assert np.abs(points[line, 1]).max() < 0.2 + 2e-3


def test_people_and_two_wheelers_are_classified_by_material(renderer: Renderer) -> None:
    cloth = box((14, -2.2, 0), (14.4, -1.8, 1.7), Material.CLOTH, (20, 20, 80), 0)
    wheels = box((14, -0.4, 0), (15.5, 0.0, 0.7), Material.RUBBER, (20, 20, 20), 2)
    rider = box((14.5, -0.4, 0.7), (14.9, 0.0, 1.6), Material.CLOTH, (90, 20, 20), 2)
    view = views(renderer, mesh=join_meshes([cloth, wheels, rider]))["A"]
    assert set(view.kind[view.actor == 0]) == {ViewClass.PERSON}
    assert set(view.kind[view.actor == 2]) == {ViewClass.TWO_WHEELER}


def test_same_input_gives_same_bytes_and_other_noise_another_image(renderer: Renderer) -> None:
    first, again, other = (views(renderer, seed=seed)["A"].image for seed in (1, 1, 2))
    assert first.tobytes() == again.tobytes()
    difference = np.abs(first.astype(int) - other)
    assert 0 < difference.mean() < 3


def test_extra_rays_at_edges_reduce_the_error(renderer: Renderer, monkeypatch: pytest.MonkeyPatch) -> None:
    refined = views(renderer)["B"].image
    large = views(renderer, CameraRig((RIG["B"].resized(480, 320),)))["B"].image
    truth = large.reshape(80, 4, 120, 4, 3).mean((1, 3))
    monkeypatch.setattr(module, "find_jagged_pixels", lambda *_: np.zeros(0, np.int32))
    plain = views(renderer)["B"].image
    error, before = (float(((image - truth) ** 2).mean()) for image in (refined, plain))
    assert error < 0.85 * before


def test_large_images_are_rendered_in_chunks(renderer: Renderer, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = views(renderer)["A"]
    monkeypatch.setattr(module, "_CHUNK", 1000)
    parts = views(renderer)["A"]
    np.testing.assert_array_equal(whole.depth_m, parts.depth_m)
    np.testing.assert_array_equal(whole.actor, parts.actor)
    # Only edges between two parts are treated differently.
    assert (np.abs(whole.image.astype(int) - parts.image).max(-1) > 8).mean() < 0.02


def test_full_hd(renderer: Renderer) -> None:
    view = views(renderer, CameraRig((camera("A", 1920, 1080, (1.5, 0.2, 1.5), 0),)))["A"]
    assert view.image.shape == (1080, 1920, 3)
    assert view.depth_m.shape == view.actor.shape == view.kind.shape == (1080, 1920)


def test_packets_and_single_rays_agree() -> None:
    mesh, random = join_meshes([town().solid, CARS]), np.random.default_rng(5)
    packets, plain = build_scene(mesh), SingleRayScene(mesh)
    assert isinstance(packets, PacketScene)  # the library that embreex brings was found
    origins = random.uniform([0, -8, 0.5], [40, 8, 5], (999, 3)).astype(np.float32)
    ways = random.normal(size=(999, 3))
    ways = (ways / np.linalg.norm(ways, axis=1, keepdims=True)).astype(np.float32)
    limits = np.full((2, 999), 30, np.float32)
    face, weights = packets.nearest(origins, ways, limits[0])
    face_plain, weights_plain = plain.nearest(origins, ways, limits[1])
    np.testing.assert_array_equal(face, face_plain)
    assert_rounded(limits[0], limits[1], TERMS)
    assert_rounded(weights[face >= 0], weights_plain[face >= 0], TERMS, size=float(np.abs(origins).max()))
    np.testing.assert_array_equal(packets.blocked(origins, ways), plain.blocked(origins, ways))
    assert 0 < (face >= 0).sum() < 999


def test_an_empty_scene_is_none() -> None:
    assert build_scene(join_meshes([])) is None
