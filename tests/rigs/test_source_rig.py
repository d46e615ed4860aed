from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from rig_texts import AHEAD, DISTORTED, FISHEYE, PINHOLE, read_one

from appocc.checks import ByteArray, FloatArray
from appocc.errors import DataError, NotFoundError, ShapeError
from appocc.lenses import DistortedLens
from appocc.rigs import SourceRig, read_rig, read_source_rig
from appocc.rigs.variation import field_of_view_deg

GREY = np.full((180, 320, 3), 90, np.uint8)


def painted(rig: SourceRig) -> dict[str, ByteArray]:
    """Pictures whose colour is the direction of each pixel's ray in the ego frame; black where they see nothing."""
    pictures = {}
    for camera in rig.cameras:
        v, u = np.indices((camera.height_px, camera.width_px), np.float64).reshape(2, -1)
        rays = camera.lens.unproject(np.stack([u, v], axis=1)) @ camera.ego_from_cam[:3, :3].T
        colour = np.nan_to_num(coloured(rays), nan=0.0)
        pictures[camera.name] = colour.reshape(camera.height_px, camera.width_px, 3).astype(np.uint8)
    return pictures


def coloured(rays: FloatArray) -> FloatArray:
    return np.asarray((100 + 100 * rays).round())


@pytest.mark.parametrize(
    "keys", [[DISTORTED, AHEAD], [FISHEYE, AHEAD, "pitch_deg: 20", "roll_deg: 4"], [FISHEYE, AHEAD, "pitch_deg: 50"]]
)
def test_every_pixel_of_a_view_shows_what_lies_in_its_direction(tmp_path: Path, keys: list[str]) -> None:
    rig = read_one(tmp_path, *keys)
    images = rig.rectify(painted(rig))
    assert tuple(images) == rig.rig.channels
    for camera in rig.rig:
        image = images[camera.channel]
        assert image.shape == (camera.height_px, camera.width_px, 3)
        v, u = np.indices(image.shape[:2], np.float64).reshape(2, -1)
        rays = np.stack([u, v, np.ones(len(u))], axis=1) @ np.linalg.inv(camera.intrinsic).T
        rays = rays / np.linalg.norm(rays, axis=1, keepdims=True) @ camera.ego_from_cam[:3, :3].T
        # No black of an unseen pixel is in it, up to the rounding of colours.
        assert np.abs(image.reshape(-1, 3) - coloured(rays)).max() <= 2


@pytest.mark.parametrize("lens", [DISTORTED, FISHEYE])
def test_pixel_classes_are_those_of_the_nearest_pixels_of_the_picture(tmp_path: Path, lens: str) -> None:
    rig = read_one(tmp_path, lens, AHEAD)
    (camera,) = rig.cameras
    classes = np.random.default_rng(0).integers(0, 9, (camera.height_px, camera.width_px)).astype(np.uint8)
    cut = rig.rectify_classes(camera.name, classes, 255)
    assert tuple(cut) == rig.rig.channels
    for view in rig.views:
        assert view.places is not None
        u, v = (np.rint(places).astype(int) for places in view.places)
        inside = (u >= 0) & (u < camera.width_px) & (v >= 0) & (v < camera.height_px)
        expected = np.where(inside, classes[v.clip(0, camera.height_px - 1), u.clip(0, camera.width_px - 1)], 255)
        # Places halfway between two pixels may take either.
        assert (cut[view.camera.channel] == expected).mean() > 0.999


def test_pixel_classes_of_another_size_are_refused(tmp_path: Path) -> None:
    rig = read_one(tmp_path, PINHOLE, AHEAD)
    classes = np.zeros((180, 320), np.uint8)
    assert rig.rectify_classes("front", classes, 255)["CAM_FRONT"] is classes
    with pytest.raises(ShapeError, match="pixel classes of front"):
        rig.rectify_classes("front", classes[:90, :160], 255)


def test_pinholes_are_taken_as_they_are(tmp_path: Path) -> None:
    rig = read_one(tmp_path, PINHOLE, AHEAD)
    assert rig.is_pinhole
    assert rig.rectify({"front": GREY})["CAM_FRONT"] is GREY
    assert rig.rig == read_rig(tmp_path / "rig.yaml")
    shipped = read_source_rig("paper")
    assert SourceRig.of_pinholes(shipped.rig).as_json() == shipped.as_json()


def test_names_and_roles_become_channels(tmp_path: Path) -> None:
    assert read_one(tmp_path, PINHOLE, AHEAD, name="CAM_FRONT").rig.channels == ("CAM_FRONT",)
    assert read_one(tmp_path, PINHOLE, AHEAD, name="cam-3").rig.channels == ("CAM_CAM_3",)
    assert read_one(tmp_path, PINHOLE, AHEAD, "role: back_left", name="7").names == ("7",)
    assert read_one(tmp_path, PINHOLE, AHEAD, "role: back_left", name="7").rig.channels == ("CAM_BACK_LEFT",)
    wide = read_one(tmp_path, FISHEYE, AHEAD)
    assert wide.channels("front") == wide.rig.channels == ("CAM_FRONT_1", "CAM_FRONT_2")


def test_a_moderate_lens_becomes_one_pinhole_of_the_same_pose(tmp_path: Path) -> None:
    rig = read_one(tmp_path, DISTORTED, AHEAD)
    (camera,), (source,) = rig.rig, rig.cameras
    assert not rig.is_pinhole
    np.testing.assert_array_equal(camera.ego_from_cam, source.ego_from_cam)
    assert 66 < field_of_view_deg(camera) < 70
    # As many pixels in the middle as the picture has.
    assert isinstance(source.lens, DistortedLens)
    assert camera.intrinsic[0, 0] == pytest.approx(source.lens.intrinsic[0, 0], rel=0.01)


@pytest.mark.parametrize(("pitch", "roll"), [(0, 0), (20, 0), (30, 5), (60, 0), (66, 0)])
def test_a_wide_lens_is_cut_into_level_views_side_by_side(tmp_path: Path, pitch: int, roll: int) -> None:
    rig = read_one(tmp_path, FISHEYE, AHEAD, f"pitch_deg: {pitch}", f"roll_deg: {roll}").rig
    edges = []
    for camera in rig:
        ahead = camera.ego_from_cam[:3, 2]
        assert ahead[2] == pytest.approx(0, abs=1e-12)
        assert camera.ego_from_cam[2, 1] == pytest.approx(-1), "its rows are level"
        left, right = np.degrees(
            np.arctan((np.array([0, camera.width_px - 1]) - camera.intrinsic[0, 2]) / camera.intrinsic[0, 0])
        )
        assert 65 < right - left < 100.5
        yaw = np.degrees(np.arctan2(ahead[1], ahead[0]))
        edges.append((yaw - left, yaw - right))
        # The horizon, and the ground 5 m away, are in it.
        places = camera.ego_from_cam[:3, 3] + 5 * ahead + np.array([[0, 0, 0], [0, 0, -1.5]])
        assert camera.sees(*camera.project_ego(places)).all()
    assert edges[0][0] > 75, "to the left"
    assert edges[-1][1] < -75, "to the right"
    assert all(one[1] == pytest.approx(other[0], abs=1.5) for one, other in pairwise(edges))


def test_a_lens_with_a_dark_rim_is_used_up_to_its_circle(tmp_path: Path) -> None:
    circle = FISHEYE.replace("[0.02, -0.005, 0.001, -0.0002]", "{coefficients: [0, 0, 0, 0], circle_deg: 140}")
    rig = read_one(tmp_path, circle, AHEAD)
    for view in rig.views:
        assert view.places is not None
        rays = rig.cameras[0].lens.unproject(view.places.reshape(2, -1).T.astype(np.float64))
        assert np.degrees(np.arccos(rays[:, 2])).max() < 70.001


def test_pictures_of_another_size_are_scaled_and_of_another_aspect_refused(tmp_path: Path) -> None:
    rig = read_one(tmp_path, PINHOLE, AHEAD)
    assert rig.scaling("front", 320, 180) is None
    told = rig.scaling("front", 1920, 1080)
    assert told == "front: expected 320x180 pixels, as size_px of its rig says, got 1920x1080; pictures are scaled"
    large = np.repeat(np.repeat(GREY, 2, axis=0), 2, axis=1)
    np.testing.assert_array_equal(rig.rectify({"front": large})["CAM_FRONT"], GREY)
    with pytest.raises(
        DataError, match="front: expected 320x180 pixels, as size_px of its rig says, got 320x240, which has"
    ):
        rig.rectify({"front": np.zeros((240, 320, 3), np.uint8)})
    with pytest.raises(NotFoundError, match="rig has no camera 'nose'; it has front"):
        rig.rectify({"nose": GREY})
    with pytest.raises(ShapeError, match="expected uint8"):
        rig.rectify({"front": GREY.astype(np.float64)})
    assert rig.rectify({}) == {}


def test_another_lens_is_another_rig(tmp_path: Path) -> None:
    one, same = (read_one(tmp_path, FISHEYE, AHEAD).as_json() for _ in range(2))
    other = read_one(tmp_path, FISHEYE.replace("0.02", "0.021"), AHEAD).as_json()
    assert one == same
    assert one != other
