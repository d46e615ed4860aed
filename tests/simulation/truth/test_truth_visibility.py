from __future__ import annotations

import numpy as np
import pytest
from made_truth_town import Street, box_mesh, made_rig, made_street, pixel_rays
from numpy.typing import NDArray

from appocc.camera import CameraRig
from appocc.checks import FloatArray
from appocc.nuscenes.writer import visibility_token
from appocc.simulation.mesh import Mesh, join_meshes
from appocc.simulation.rendering.tracing import ACTOR, Tracer
from appocc.simulation.truth.visibility import visible_shares

CAR = ("car", "sedan", (4.6, 1.8, 1.5))
BUS = ("bus", "bus", (11.0, 2.5, 3.1))
PERSON = ("pedestrian", "adult", (0.6, 0.6, 1.75))
EGO = np.eye(4)


Rays = list[tuple[NDArray[np.float32], NDArray[np.float32]]]


def counts(tracer: Tracer, mesh: Mesh, rays: Rays, actors: int) -> NDArray[np.int64]:
    """Count the pixels of each actor over all cameras in full images of actor indices."""
    total = np.zeros(actors, np.int64)
    for origins, directions in rays:
        hits = tracer.nearest(origins, directions)
        total += np.bincount(mesh.tag[hits.face[hits.source == ACTOR]], minlength=actors)
    return total


def brute_force(street: Street, rig: CameraRig) -> FloatArray:
    """Return visible pixels of each actor relative to those of the actor alone."""
    rays = [pixel_rays(camera.resized(400, 225), EGO) for camera in rig]
    seen = counts(street.tracer, street.mesh, rays, len(street.actors))
    alone = np.zeros(len(street.actors), np.int64)
    for i in range(len(street.actors)):
        own = street.mesh.tag == i
        mesh = street.mesh
        one = Mesh(
            vertices_m=mesh.vertices_m,
            normals=mesh.normals,
            uv=mesh.uv,
            faces=mesh.faces[own],
            material=mesh.material[own],
            tint=mesh.tint[own],
            tag=mesh.tag[own],
        )
        tracer = Tracer(join_meshes([]))
        tracer.set_actors(one)
        alone[i] = counts(tracer, one, rays, len(street.actors))[i]
    return np.divide(seen, alone, out=np.zeros(len(seen)), where=alone > 0)


@pytest.fixture(scope="module")
def street() -> Street:
    rows = [
        (*CAR, 8, 0, 0.1),
        (*CAR, 16, 0.6, 0.0),  # behind the first
        (*BUS, 14, -5, 0.0),
        (*CAR, 16, -8.4, 0.3),  # behind the bus
        (*CAR, 22, 3.4, 0.0),  # partly behind the first
        (*CAR, 12, 11, 0.0),  # behind the wall
        (*PERSON, 6, 3, 0.0),
        (*CAR, 1.5, 4, 0.0),  # in two cameras
        (*BUS, -16, 2, 1.2),
        (*CAR, -24, 6, 0.0),
        (*PERSON, 25, 2.5, 0.0),
        (*CAR, 40, -3.0, 0.0),
    ]
    return made_street(rows)


def test_shares_agree_with_full_images(street: Street) -> None:
    numbers = np.arange(len(street.actors), dtype=np.int32)
    shares = visible_shares(street.tracer, street.mesh, numbers, made_rig(), EGO, 64)
    truth = brute_force(street, made_rig())
    assert np.abs(shares - truth).max() < 0.08
    assert np.abs(shares - truth).mean() < 0.02
    assert truth.min() < 0.1
    assert truth.max() == 1
    assert ((truth > 0.2) & (truth < 0.8)).any()


def test_shares_follow_the_order_of_the_indices(street: Street) -> None:
    numbers = np.array([5, 1, 99], np.int32)
    every = visible_shares(street.tracer, street.mesh, np.arange(12, dtype=np.int32), made_rig(), EGO)
    assert visible_shares(street.tracer, street.mesh, numbers, made_rig(), EGO).tolist() == [every[5], every[1], 0.0]


def test_truncation_by_the_image_border_is_not_occlusion(street: Street) -> None:
    front = CameraRig(made_rig().cameras[:1])
    alone = made_street([(*CAR, 3.0, 3.0, 0.0)], box_mesh((0, 40, 1), (1, 1, 1)))
    assert visible_shares(alone.tracer, alone.mesh, np.array([0], np.int32), front, EGO).tolist() == [1.0]


def test_actors_behind_the_only_camera_are_not_visible() -> None:
    front = CameraRig(made_rig().cameras[:1])
    street = made_street([(*CAR, -8.0, 0.0, 0.0)])
    assert visible_shares(street.tracer, street.mesh, np.array([0], np.int32), front, EGO).tolist() == [0.0]


@pytest.mark.parametrize(
    ("share", "token"), [(0.0, "1"), (0.39, "1"), (0.4, "2"), (0.59, "2"), (0.6, "3"), (0.8, "4"), (1.0, "4")]
)
def test_levels(share: float, token: str) -> None:
    assert visibility_token(share) == token
