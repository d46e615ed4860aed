"""Pictures of cameras with other lenses, ray by ray: rectified, they are those of pinholes."""

from __future__ import annotations

import numpy as np
import pytest
from made_render_town import car, town

from appocc.camera import CameraRig
from appocc.checks import ByteArray
from appocc.ego_vehicle import EgoVehicle
from appocc.geometry import quaternion_from_yaw, transform
from appocc.lenses import DistortedLens, Lens, kannala_brandt
from appocc.rigs import SourceRig
from appocc.rigs.cutting import cut_views
from appocc.rigs.poses import mounting_rotation
from appocc.rigs.source_camera import SourceCamera
from appocc.simulation.mesh import join_meshes
from appocc.simulation.rendering.pixel_rays import LensRays, PinholeRays
from appocc.simulation.rendering.renderer import Renderer
from appocc.simulation.rendering.weather import WEATHERS

POSE = transform(quaternion_from_yaw(0.2), [8.0, -1.5, 0.0])
CARS = join_meshes([car(20, -2, 3), car(16, 6, 1, (240, 240, 240))])
WIDE, HIGH = 320, 240


def intrinsic(focal: float) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    return np.array([[focal, 0, (WIDE - 1) / 2], [0, focal, (HIGH - 1) / 2], [0, 0, 1]])


PINHOLE = DistortedLens(intrinsic(200.0), np.zeros(4))
DISTORTED = DistortedLens(intrinsic(200.0), np.array([-0.32, 0.12, 0.001, -0.001, -0.02]))
FISHEYE = kannala_brandt(intrinsic(96.0), [0.02, -0.005, 0.001, -0.0002], 192)


@pytest.fixture(scope="module")
def renderer() -> Renderer:
    made = Renderer(town())
    made.set_scene(CARS, np.zeros(4, np.uint8), np.zeros(0, np.uint8), WEATHERS["clear"], None)
    return made


def mounted(lens: Lens, pitch_deg: float = 0.0) -> SourceCamera:
    pose = transform(mounting_rotation(10, pitch_deg, 0), [1.5, 0.2, 1.5])
    return SourceCamera("nose", "CAM_NOSE", WIDE, HIGH, lens, pose)


def picture(renderer: Renderer, camera: SourceCamera) -> ByteArray:
    return renderer.lens_images([camera], POSE, np.random.default_rng(0))["nose"]


def test_a_lens_without_distortion_is_a_pinhole(renderer: Renderer) -> None:
    camera = mounted(PINHOLE)
    (view,) = cut_views(camera)
    pixels = np.arange(0, WIDE * HIGH, 97, dtype=np.int32)
    for shift in (0.0, 0.36):
        _, one = LensRays(camera, POSE).rays(pixels, shift, -shift)
        _, other = PinholeRays(view.camera, POSE).rays(pixels, shift, -shift)
        np.testing.assert_allclose(one, other, atol=2e-6)
    image = renderer.views(CameraRig((view.camera,)), POSE, np.random.default_rng(0))["CAM_NOSE"].image
    difference = np.abs(picture(renderer, camera).astype(int) - image)
    # A ray that rounds to the other side of an edge changes its pixel.
    assert np.quantile(difference, 0.999) <= 1


@pytest.mark.parametrize(("lens", "pitch_deg"), [(DISTORTED, 0.0), (FISHEYE, 20.0)])
def test_rectified_pictures_are_those_of_pinholes(renderer: Renderer, lens: Lens, pitch_deg: float) -> None:
    camera = mounted(lens, pitch_deg)
    rig = SourceRig((camera,), cut_views(camera), EgoVehicle())
    images = rig.rectify({"nose": picture(renderer, camera)})
    wanted = renderer.views(rig.rig, POSE, np.random.default_rng(0))
    maps = renderer.maps(rig.rig, POSE)
    assert set(images) == set(wanted) == set(maps) == set(rig.rig.channels)
    for channel, view in wanted.items():
        difference = np.abs(images[channel].astype(int) - view.image).mean(axis=2)
        # Noise, vignetting and edges between two resolutions differ; a shift by two pixels is seen.
        assert np.median(difference) < 6
        shifted = np.abs(images[channel][:, 4:].astype(int) - view.image[:, :-4]).mean(axis=2)
        assert difference.mean() < 0.75 * shifted.mean()
        np.testing.assert_array_equal(maps[channel].depth_m, view.depth_m)
        np.testing.assert_array_equal(maps[channel].kind, view.kind)


def test_what_lies_beyond_the_image_circle_is_black(renderer: Renderer) -> None:
    image = picture(renderer, mounted(kannala_brandt(intrinsic(96.0), [0, 0, 0, 0], 100)))
    v, u = np.indices((HIGH, WIDE))
    beyond = np.hypot(u - (WIDE - 1) / 2, v - (HIGH - 1) / 2) > 96.0 * np.radians(50) + 1
    assert image[beyond].mean() < 6
    assert image[~beyond].mean() > 40
