from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from street import BLUE, EGO, WHITE, WORLD_FROM_EGO, Street

from appocc.camera import Camera, CameraRig
from appocc.checks import ByteArray
from appocc.frame import Frame
from appocc.geometry import footprints, quaternion_from_rotation, transform
from appocc.visualization.canvas import BEVCanvas
from grounding.visualization import CYAN, draw_answer

INTRINSIC = np.array([[300.0, 0, 319.5], [0, 300.0, 179.5], [0, 0, 1]])
AHEAD = np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])
STREET = Street().car("w1", 12, -3, WHITE).car("w2", 20, 3, WHITE).car("b", 26, -2, BLUE).car("back", -12, 0, BLUE)
GROUNDER = STREET.grounder()


def camera(channel: str, rotation: np.typing.NDArray[np.float64]) -> Camera:
    pose = transform(quaternion_from_rotation(rotation), [1.0, 0.0, 1.6])
    return Camera(channel, 640, 360, INTRINSIC.copy(), pose)


def frame(images: bool = True) -> Frame:
    behind = np.diag([-1.0, -1.0, 1.0]) @ AHEAD
    rig = CameraRig((camera("CAM_FRONT", AHEAD), camera("CAM_BACK", behind)))
    pictures = {c.channel: np.full((360, 640, 3), 120, np.uint8) for c in rig} if images else {}
    return Frame("token", 0, WORLD_FROM_EGO, rig, pictures, STREET.boxes())


def cyan_pixels(picture: ByteArray) -> int:
    return int(np.count_nonzero((picture == np.array(CYAN, np.uint8)).all(axis=2)))


@pytest.mark.parametrize(
    "text",
    [
        "stop behind the nearest blue car ahead",
        "stop behind the white car",
        "stop behind the pink bus",
        "stop",
        "tell me a joke",
        "停在白色汽车后面",
        "x" * 9000,
        "park behind the car " * 24,
    ],
)
def test_every_status_has_a_picture(text: str) -> None:
    answer = GROUNDER.ground(text)
    picture = draw_answer(answer, frame())
    assert picture.dtype == np.uint8
    assert picture.shape[2] == 3
    assert picture.shape[1] > 800 + 640
    assert (cyan_pixels(picture) > 0) == (answer.target is not None)


def test_the_target_is_marked_in_map_and_camera() -> None:
    answer = GROUNDER.ground("stop behind the nearest blue car ahead")
    picture = draw_answer(answer, frame())
    assert answer.target is not None
    assert cyan_pixels(picture[:, :800]) > 100
    assert cyan_pixels(picture[:, 800:]) > 100


def test_the_ego_has_the_same_size_now_and_at_the_target() -> None:
    answer = GROUNDER.ground("stop behind the nearest blue car ahead")
    assert answer.target is not None
    canvas, own = (BEVCanvas(STREET.grid, 4) for _ in range(2))
    for one in (canvas, own):
        one.picture[:] = 0  # without the hatching
    canvas.ego(EGO)
    own.line(footprints([EGO.centre_m, 0.0], 0.0, [EGO.length_m, EGO.width_m]), WHITE, 2, closed=True)
    for axis in (0, 1):
        drawn, expected = (np.flatnonzero(one.picture.max(axis=2).max(axis=axis) > 128) for one in (canvas, own))
        assert (drawn.min(), drawn.max()) == (expected.min(), expected.max())
    sides = np.linalg.norm(np.diff(answer.target.footprint(), axis=0), axis=1)
    assert sides == pytest.approx([EGO.length_m, EGO.width_m, EGO.length_m])


def test_the_camera_that_sees_the_referent_is_shown() -> None:
    front, back = (frame().images[c].copy() for c in ("CAM_FRONT", "CAM_BACK"))
    front[:], back[:] = (10, 60, 10), (60, 10, 10)
    bare = frame(images=False)
    images = {"CAM_FRONT": front, "CAM_BACK": back}
    moment = Frame(bare.token, 0, WORLD_FROM_EGO, bare.rig, images, bare.boxes_ego)
    shown = {"stop behind the blue car ahead": (10, 60, 10), "stop behind the car behind us": (60, 10, 10)}
    for text, background in shown.items():
        picture = draw_answer(GROUNDER.ground(text), moment)
        assert tuple(int(v) for v in np.median(picture[300:, 800:].reshape(-1, 3), axis=0)) == background


def test_without_images_only_the_map_is_drawn() -> None:
    picture = draw_answer(GROUNDER.ground("stop behind the white car"), frame(images=False))
    assert picture.shape[1] == 800


def test_instances_are_drawn_with_a_default_height() -> None:
    bare = frame()
    moment = Frame(bare.token, 0, WORLD_FROM_EGO, bare.rig, bare.images, None)
    answer = STREET.grounder(boxes=False).ground("stop behind the nearest blue vehicle ahead")
    assert answer.status == "ok"
    assert cyan_pixels(draw_answer(answer, moment)[:, 800:]) > 100


def test_a_place_behind_a_vehicle_is_hidden_by_it() -> None:
    street = Street().car("near", 9, 0, WHITE).car("far", 24, 0, BLUE)
    answer = street.grounder().ground("park in front of the white car")
    assert answer.target is not None
    assert answer.target.ego_m[0] > 12
    seen = frame()
    hidden = draw_answer(answer, replace(seen, boxes_ego=street.boxes()))[:, 800:]
    clear = draw_answer(replace(answer, scene=Street().grounder().ground("stop").scene), seen)[:, 800:]
    assert cyan_pixels(clear) > 3 * cyan_pixels(hidden)


def test_the_caption_is_as_high_as_its_reasons() -> None:
    heights = set()
    for text in ("stop behind the nearest blue car ahead", "stop behind the pink bus", "tell me a joke"):
        answer = GROUNDER.ground(text)
        rows = draw_answer(answer).shape[0] - 800
        assert rows == 72 + 22 * min(len(answer.reasons), 6)
        heights.add(rows)
    assert len(heights) > 1
