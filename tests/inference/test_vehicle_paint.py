"""Paint of predicted vehicles from images that a made camera takes of a made street."""

from __future__ import annotations

import numpy as np
import pytest
from made_objects import made_object, together
from made_street import BLUE, RED, YAW, Solid, camera, car, photograph

from appocc.checks import ByteArray, FloatArray
from appocc.colours import lab_from_rgb
from appocc.inference.second_stage.vehicle_paint import paint_from_images
from appocc.objects import BEVObjects

GREY = (128.0, 128.0, 128.0)
SIZE_WLH_M = (2.0, 4.0, 1.5)


def found(x_m: float, y_m: float, rgb: tuple[float, ...] = GREY, score: float = 0.9, kind: str = "car") -> BEVObjects:
    """The object of a made car."""
    return made_object(kind, x_m, y_m, centre_m=[x_m, y_m, 0.75], size_wlh_m=SIZE_WLH_M, rgb=rgb, score=score)


def painted(objects: BEVObjects, solids: list[Solid], channels: tuple[str, ...] = tuple(YAW)) -> FloatArray:
    """CIELAB of the paints (N, 3), from images of the solids by some cameras."""
    cameras = [camera(channel) for channel in channels]
    images: list[ByteArray] = [photograph(one, one.ego_from_cam, solids).transpose(2, 0, 1) for one in cameras]
    return lab_from_rgb(paint_from_images(objects, np.stack(images), cameras).rgb)


def hue_deg(lab: FloatArray) -> float:
    return float(np.degrees(np.arctan2(lab[2], lab[1])))


@pytest.mark.parametrize("rgb", [RED, BLUE])
def test_hue_is_that_of_the_image_and_lightness_in_between(rgb: tuple[int, int, int]) -> None:
    for cells in ((90.0, 90.0, 90.0), (220.0, 220.0, 220.0)):
        lab = painted(found(10, 2, cells), [car(10, 2, rgb, "a")])[0]
        image, cell = lab_from_rgb(rgb), lab_from_rgb(cells)
        assert hue_deg(lab) == pytest.approx(hue_deg(image), abs=6)
        assert min(image[0], cell[0]) - 1 < lab[0] < max(image[0], cell[0]) + 1
        assert np.hypot(*lab[1:]) > 20


def test_each_vehicle_has_its_own_paint_also_behind_another() -> None:
    near, far = (9.0, -0.7), (16.0, -3.5)
    lab = painted(together(found(*near), found(*far)), [car(*near, BLUE, "blue"), car(*far, RED, "red")])
    assert hue_deg(lab[0]) == pytest.approx(hue_deg(lab_from_rgb(BLUE)), abs=6)
    assert hue_deg(lab[1]) == pytest.approx(hue_deg(lab_from_rgb(RED)), abs=6)


def test_an_unknown_paint_is_that_of_the_image() -> None:
    lab = painted(found(10, 2, (np.nan,) * 3), [car(10, 2, RED, "a")])[0]
    np.testing.assert_allclose(lab, lab_from_rgb(RED), atol=2)


def test_what_no_image_shows_keeps_its_paint() -> None:
    """Behind the only camera, wholly hidden, of a low score, or a person."""
    wall = Solid((5.0, -6.0, 0.0), (6.0, 6.0, 3.0), BLUE, "vehicle.car", "wall")
    hider = made_object("truck", 5.5, 0.0, centre_m=[5.5, 0.0, 1.5], size_wlh_m=(12.0, 1.0, 3.0), rgb=GREY)
    objects = together(found(-10, 2), found(12, 0), found(10, 8, score=0.1), found(10, 12, kind="pedestrian"), hider)
    solids = [car(-10, 2, RED, "a"), car(12, 0, RED, "b"), car(10, 8, RED, "c"), car(10, 12, RED, "d"), wall]
    lab = painted(objects, solids, ("CAM_FRONT",))
    np.testing.assert_allclose(lab[:4], np.tile(lab_from_rgb(GREY), (4, 1)), atol=1e-6)
    assert hue_deg(lab[4]) == pytest.approx(hue_deg(lab_from_rgb(BLUE)), abs=6)


def test_no_objects() -> None:
    none = found(10, 2).select(np.zeros(1, np.bool_))
    assert len(painted(none, [car(10, 2, RED, "a")])) == 0
