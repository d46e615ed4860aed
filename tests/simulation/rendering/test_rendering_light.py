from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_render_town import LAMP_M, box, camera, car, down, town
from numpy.typing import NDArray

from appocc.camera import CameraRig
from appocc.errors import NotFoundError
from appocc.geometry import transform
from appocc.simulation.mesh import Material, Mesh, join_meshes
from appocc.simulation.rendering import camera_response
from appocc.simulation.rendering.lighting import EgoBody
from appocc.simulation.rendering.materials import shop_pane
from appocc.simulation.rendering.renderer import Renderer
from appocc.simulation.rendering.weather import WEATHERS, Weather, draw_weather
from appocc.simulation.traffic import Light

CLEAR = replace(
    WEATHERS["clear"], sun_azimuth_rad=np.pi / 2, sun_elevation_rad=0.7, cloudiness=0.0
)  # sun in the north
NO_BYTES = np.zeros(0, np.uint8)


@pytest.fixture(scope="module")
def renderer() -> Renderer:
    return Renderer(town())


def brightness(
    renderer: Renderer,
    places: list[tuple[float, float]],
    weather: Weather,
    mesh: Mesh | None = None,
    ego: EgoBody | None = None,
    shown: int = 0,
) -> NDArray[np.float32]:
    """Return the radiance (N,) of points on the ground."""
    renderer.set_scene(mesh or join_meshes([]), np.full(9, shown, np.uint8), NO_BYTES, weather, ego)
    return np.asarray(renderer.radiance(*down(places), 0.001).mean(1), np.float32)


def ahead(renderer: Renderer, target: tuple[float, float, float]) -> NDArray[np.float32]:
    """Return the radiance (3,) of a point along a ray from five metres in front of it (towards -x)."""
    origin = np.array([[target[0] - 5, target[1], target[2]]], np.float32)
    return np.asarray(renderer.radiance(origin, np.array([[1, 0, 0]], np.float32), 0.001)[0])


def test_shadows_fall_away_from_the_sun(renderer: Renderer) -> None:
    sunny, shaded = brightness(renderer, [(20, 2.7), (20, -2.3)], CLEAR, box((19, -1, 0), (21, 1, 3), Material.PLAIN))
    assert shaded < 0.45 * sunny


def test_the_ego_casts_a_shadow_without_a_mesh(renderer: Renderer) -> None:
    ego = EgoBody(transform(np.eye(3), [10.0, 0.0, 0.0]), (4.5, 1.9, 1.6))
    without = brightness(renderer, [(11, -1.4), (11, 2.5)], CLEAR)
    with_ego = brightness(renderer, [(11, -1.4), (11, 2.5)], CLEAR, ego=ego)
    assert with_ego[0] < 0.5 * without[0]
    assert with_ego[1] == pytest.approx(without[1], rel=0.02)


def test_it_is_dark_below_a_car_without_sun(renderer: Renderer) -> None:
    below = car(20, -2, 0)
    places = [(20.0, -2.0 - 0.98), (20.0, -2.0 - 3.0)]
    near, far = brightness(renderer, places, WEATHERS["overcast"], below)
    assert near < 0.8 * far


def test_night_is_darker_and_lamps_shine(renderer: Renderer) -> None:
    below, away = (LAMP_M[0], LAMP_M[1] + 2.5), (3.0, 3.0)
    day, night = (brightness(renderer, [below, away], WEATHERS[name]) for name in ("overcast", "night"))
    assert night[1] < 0.1 * day[1]
    assert night[0] > 3 * night[1]


def test_the_ego_lights_the_street_ahead_of_it_at_night(renderer: Renderer) -> None:
    ego = EgoBody(transform(np.eye(3), [10.0, -2.0, 0.0]), (4.5, 1.9, 1.6))
    places = [(24.0, -2.0), (2.0, -2.0)]
    dark, lit = (brightness(renderer, places, WEATHERS["night"], ego=who) for who in (None, ego))
    assert lit[0] > dark[0] + 0.02
    assert lit[1] < dark[1] + 0.005


@pytest.mark.parametrize(("letter", "bright"), [("r", 0), ("y", 1), ("g", 2), ("G", 2), ("O", None), ("u", 0)])
def test_signals_show_their_letter(renderer: Renderer, letter: str, bright: int | None) -> None:
    weather = WEATHERS["overcast"]
    renderer.set_scene(join_meshes([]), NO_BYTES, np.array([ord(letter)], np.uint8), weather, None)
    lamps = [ahead(renderer, (20, -7.9, 4.1 - k)) for k in range(3)]
    colours = [camera_response.tone_map(lamp, renderer.gains).astype(int) for lamp in lamps]
    if bright is None:
        assert max(colour.max() for colour in colours) < 130
        return
    shown = colours[bright]
    assert int(np.argmax([colour.max() for colour in colours])) == bright or letter == "u"
    assert shown.max() > 200
    if bright == 0:
        assert shown[0] > 2 * max(shown[1], shown[2])
    if bright == 2:
        assert shown[1] > 2 * shown[0]


def test_brake_lamps_are_brighter_and_parked_cars_dark(renderer: Renderer) -> None:
    red = {}
    for bits in (0, int(Light.BRAKE), int(Light.PARKED)):
        renderer.set_scene(car(20, -2, 0), np.array([bits], np.uint8), NO_BYTES, WEATHERS["night"], None)
        red[bits] = ahead(renderer, (17.95, -2, 0.75))[0]
    assert red[Light.BRAKE] > 2 * red[0]
    assert red[0] > 5 * red[Light.PARKED]


def test_wet_streets_reflect_the_scene_behind_them(renderer: Renderer) -> None:
    wet = WEATHERS["wet"]
    # Seen from afar, the street before a red box: a film of water mirrors at small angles only.
    origins = np.tile(np.array([[0, 0, 1.2]], np.float32), (60, 1))
    targets = np.stack([np.linspace(16, 17, 60), np.full(60, 0.0), np.zeros(60)], 1)
    ways = targets - origins
    ways = (ways / np.linalg.norm(ways, axis=1, keepdims=True)).astype(np.float32)
    redness = []
    for weather in (replace(wet, wetness=0.0), wet):
        renderer.set_scene(
            box((20, -4, 0), (21, 4, 4), Material.PLAIN, (230, 20, 20)), NO_BYTES, NO_BYTES, weather, None
        )
        light = renderer.radiance(origins, ways, 0.001).mean(0)
        redness.append(light[0] / light[1])
    assert redness[1] > 1.1 * redness[0]


@pytest.mark.parametrize("shop", range(1, 7))
def test_shops_show_one_room_without_hard_tiles(shop: int) -> None:
    frame = (0.9, 0.9, 0.9)
    shown = np.array([shop_pane(u, 1.2, shop, frame, 1.0) for u in np.arange(0.0, 8.0, 0.04)])
    is_frame = shown[:, 3] == 0
    assert 0.03 < is_frame.mean() < 0.15
    assert (shown[is_frame, :3] == 0.9).all()
    steps = np.abs(np.diff(shown[:, :3], axis=0))[~is_frame[1:] & ~is_frame[:-1]]
    assert steps.max() < 0.12
    lit = shown[~is_frame, 4] > 0
    assert lit.all() or not lit.any()
    above = shop_pane(0.8, 2.9, shop, frame, 0.0)
    assert above[0] < 0.15  # the room is dark below its ceiling
    assert above[4] == 0.0  # and by day no lamps burn


def test_lamp_light_fades_before_the_border_of_the_near_map(renderer: Renderer) -> None:
    # Tail lamps 156 m apart: the map around their middle ends two metres behind the first.
    cars = join_meshes([_tail_lamp(-60.0, 0), _tail_lamp(96.0, 1)])
    street = [(-60.3 - 0.2 * k, 0.0) for k in range(20)]
    glow = brightness(renderer, street, WEATHERS["night"], cars, shown=int(Light.BRAKE))
    glow -= brightness(renderer, street, WEATHERS["night"], cars, shown=int(Light.PARKED))
    assert glow.max() > 1e-4
    assert np.abs(np.diff(glow)).max() < 0.5 * glow.max()
    assert glow[-8:] == pytest.approx(0.0)


def _tail_lamp(x_m: float, tag: int) -> Mesh:
    """The side towards -x of a lamp."""
    lamp = box((x_m, -0.8, 0.6), (x_m + 0.1, 0.8, 0.9), Material.TAIL_LAMP, (120, 16, 18), tag)
    back = np.s_[2:4]
    return replace(
        lamp, faces=lamp.faces[back], material=lamp.material[back], tint=lamp.tint[back], tag=lamp.tag[back]
    )


def test_paint_keeps_its_colour_in_sun_and_shade(renderer: Renderer) -> None:
    for tint in ((190, 30, 30), (30, 60, 150)):
        renderer.set_scene(car(20, -2, 0, tint), np.zeros(1, np.uint8), NO_BYTES, CLEAR, None)
        origins = np.array([[20, 3, 0.6], [20, -7, 0.6]], np.float32)
        ways = np.array([[0, -1, 0], [0, 1, 0]], np.float32)
        light = renderer.radiance(origins, ways, 0.001)
        assert light[0].mean() > 1.8 * light[1].mean()  # the side to the sun
        assert list(light.argmax(1)) == [int(np.argmax(tint))] * 2


def test_rays_can_skip_foliage() -> None:
    crown = box((8, -4, 3), (12, 4, 5), Material.FOLIAGE, (40, 90, 30))
    renderer = Renderer(town(crown))
    renderer.set_scene(join_meshes([]), NO_BYTES, NO_BYTES, WEATHERS["overcast"], None)
    closed, through = (renderer.radiance(*down([(10, 0)]), 0.001, see_through_leaves=see)[0] for see in (False, True))
    assert closed[1] > 1.3 * closed[2]
    assert through[1] < 1.1 * through[2]


def test_haze_applies_to_images_only(renderer: Renderer) -> None:
    rig = CameraRig((camera("A", 64, 32, (0.0, 0.0, 1.5), 90),))
    images = []
    for haze in (0.0, 0.2):
        weather = replace(WEATHERS["overcast"], haze_per_m=haze)
        renderer.set_scene(join_meshes([]), NO_BYTES, NO_BYTES, weather, None)
        view = renderer.views(rig, transform(np.eye(3), [20.0, -8.0, 0.0]), np.random.default_rng(0))["A"]
        images.append(view.image[:14].astype(float))
    assert images[1].std() < 0.5 * images[0].std()
    above = [
        brightness(renderer, [(20, 3)], replace(WEATHERS["overcast"], haze_per_m=haze))[0] for haze in (0.0, 0.2)
    ]
    assert above[0] == above[1]


def test_weathers_are_drawn_from_a_seed() -> None:
    for name in WEATHERS:
        first, again, other = (draw_weather(name, np.random.default_rng(seed)) for seed in (1, 1, 2))
        assert first == again != other
        assert first.name == name
        assert (first.sun[0] > 0) == (WEATHERS[name].sun[0] > 0)
        assert 0 <= first.cloudiness <= 1


def test_an_unknown_weather_is_refused() -> None:
    with pytest.raises(NotFoundError, match="no weather 'snow'; there are clear"):
        draw_weather("snow", np.random.default_rng(0))


def test_the_tone_curve_rises_and_ends_at_white() -> None:
    light = np.geomspace(1e-3, 100, 200, dtype=np.float32)[:, None].repeat(3, 1)
    picture = camera_response.tone_map(light, np.ones(3, np.float32)).astype(int)
    assert (np.diff(picture, axis=0) >= 0).all()
    assert picture[0].max() < 10
    assert picture[-1].min() == 255
    assert 80 < camera_response.tone_map(np.full(3, 0.18, np.float32), np.ones(3, np.float32)).mean() < 150


def test_noise_is_that_of_a_sensor() -> None:
    gains, random = np.ones(3, np.float32), np.random.default_rng(0)
    pictures = [
        camera_response.apply_response(np.full((60, 80, 3), v, np.float32), gains, 0.0, random) for v in (0.02, 0.3)
    ]
    middle = [picture[20:40, 30:50].astype(float) for picture in pictures]
    assert all(0.3 < picture.std() < 6 for picture in middle)
    # Corners are darker.
    assert pictures[1][:5, :5].mean() < pictures[1][28:32, 38:42].mean() - 5
