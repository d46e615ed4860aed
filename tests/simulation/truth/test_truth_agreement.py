"""The checks of `benchmarks.simulator_truth` on a hand-made street of box-shaped actors."""

from __future__ import annotations

import numpy as np
import pytest
from made_truth_town import Street, made_rig, made_street

from appocc.camera import CameraRig
from appocc.geometry import quaternion_from_yaw, transform
from appocc.grid import BEVGrid
from appocc.simulation.rendering.lidar import simulate_sweep
from appocc.simulation.rendering.renderer import Renderer
from appocc.simulation.rendering.weather import WEATHERS
from appocc.simulation.truth.objects import category_indices, objects_near
from appocc.simulation.truth.occupancy import vehicle_cells
from benchmarks.simulator_truth import TruthFrame, box_ious, depth_errors, lidar_camera, mask_iou, silhouettes

CAR = ("car", "sedan", (4.6, 1.8, 1.5))
EGO = transform(quaternion_from_yaw(0.4), np.array([-3.0, 1.0, 0.0]))


@pytest.fixture(scope="module")
def street() -> Street:
    return made_street([(*CAR, 9, 3, 0.5), (*CAR, -14, -4, 2.0), (*CAR, 6, -9, 0.2), (*CAR, 0, 14, 1.0)])


@pytest.fixture(scope="module")
def renderer(street: Street) -> Renderer:
    made = Renderer(street.town)
    made.set_scene(street.mesh, np.zeros(4, np.uint8), np.zeros(0, np.uint8), WEATHERS["overcast"], None)
    return made


@pytest.fixture(scope="module")
def frame(street: Street, renderer: Renderer) -> TruthFrame:
    objects = objects_near(street.actors, street.state, np.zeros(2), np.inf)
    return TruthFrame(EGO, street.mesh, objects, renderer.tracer)


def test_projected_boxes_enclose_the_pixels_of_their_vehicles(frame: TruthFrame, renderer: Renderer) -> None:
    ious = np.array(box_ious(frame, made_rig(), renderer.views(made_rig(), EGO, np.random.default_rng(0))))
    assert len(ious) >= 2
    assert ious.min() > 0.93


def test_lidar_and_image_measure_the_same_depth(frame: TruthFrame, street: Street, renderer: Renderer) -> None:
    found = simulate_sweep(frame.tracer, street.town, street.mesh, category_indices(street.actors), EGO, None)
    camera = lidar_camera(0.2, 640, 360)
    errors = depth_errors(
        found, camera, renderer.views(CameraRig((camera,)), EGO, np.random.default_rng(0))[camera.channel]
    )
    assert len(errors) > 2000
    assert np.abs(errors).max() < 0.01


def test_the_vehicle_layer_covers_the_meshes_from_above(frame: TruthFrame) -> None:
    grid = BEVGrid.surround()
    layer, outline = vehicle_cells(grid, EGO, frame.objects), silhouettes(grid, frame, 8)
    both, either = mask_iou(layer >= 0, outline >= 0)
    assert both / either > 0.95
    agreed = (layer >= 0) & (outline >= 0)
    assert (layer[agreed] == outline[agreed]).all()
