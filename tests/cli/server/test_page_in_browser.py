"""The page in a headless browser: open, play, ask, be asked, choose, hover, click, zoom."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import pytest
from made_recording import SCENE
from served_page import FRAMES, Served, at_frame, drawn, opened, pixel, say, until

if TYPE_CHECKING:
    from playwright.sync_api import Page


def test_it_opens_with_cameras_and_both_maps(served: Served, page: Page) -> None:
    opened(page, served.address)
    tiles = page.locator(".camera")
    assert [tile.get_attribute("data-channel") for tile in tiles.all()] == [
        *("CAM_FRONT_LEFT", "CAM_FRONT", "CAM_FRONT_RIGHT", "CAM_BACK_LEFT", "CAM_BACK", "CAM_BACK_RIGHT")
    ]
    loaded = "[...document.querySelectorAll('.camera img')].every((one) => one.naturalWidth === 96)"
    until(page, lambda: bool(page.evaluate(loaded)))
    assert page.text_content("#map figcaption") == "predicted"
    assert page.text_content("#truth figcaption") == "truth (exact)"
    assert page.locator("#scene option").text_content() == SCENE, "a name is text, and no HTML"
    assert page.locator("#scene b, header b").count() == 0


def test_it_plays_to_the_end_and_steps_by_keys(served: Served, page: Page) -> None:
    opened(page, served.address)
    page.keyboard.press("Space")
    at_frame(page, FRAMES - 1)
    until(page, lambda: page.get_attribute("#play", "aria-label") == "Play")
    page.keyboard.press("ArrowLeft")
    at_frame(page, FRAMES - 2)
    page.keyboard.press("Home")
    at_frame(page, 0)
    page.keyboard.press("Shift+ArrowRight")
    at_frame(page, FRAMES - 1)
    page.locator("#time").fill("2")
    at_frame(page, 2)


def test_it_asks_and_a_button_answers(served: Served, page: Page) -> None:
    opened(page, f"{served.address}?frame=1")
    say(page, "stop behind the white car")
    assert (page.text_content("#turns .question") or "").endswith("?")
    buttons = page.locator("#replies .choice")
    assert buttons.count() == 2
    buttons.filter(has_text="left").click()
    until(page, lambda: page.locator("#turns .goal").count() == 1)
    goal = page.locator("#turns .goal")
    assert "Goal" in (goal.text_content() or "")
    assert re.fullmatch(r"cell \d+, \d+", goal.get_attribute("title") or "")
    assert "to the left" in (goal.text_content() or "")
    assert drawn(page, "b > 200 && g > 160 && r < 130") > 20, "the goal and the way are on the map"
    say(page, "and then turn right")
    assert page.locator("#turns .said").count() == 3


def test_the_vehicles_of_an_open_question_stay_marked_while_time_goes_on(served: Served, page: Page) -> None:
    amber = "r > 230 && g > 180 && g < 225 && b < 90"
    opened(page, f"{served.address}?frame=1")
    assert drawn(page, amber) == 0
    say(page, "stop behind the white car")
    marked = drawn(page, amber)
    assert marked > 50
    page.keyboard.press("Escape")
    page.keyboard.press("ArrowRight")
    at_frame(page, 2)
    until(page, lambda: drawn(page, amber) > marked / 2)
    assert page.locator("#replies .choice").count() == 2


def test_a_question_is_told_above_its_buttons_after_an_aside(served: Served, page: Page) -> None:
    opened(page, f"{served.address}?frame=1")
    say(page, "stop behind the red car")
    say(page, "park behind the white car")
    question = page.text_content("#turns .question")
    assert page.locator("#replies .open").count() == 0, "it is in the answer just above"
    say(page, "where are you heading?")
    assert page.text_content("#replies .open") == question
    assert page.locator("#replies .choice").count() == 2


def test_a_sentence_is_text_and_no_html(served: Served, page: Page) -> None:
    opened(page, f"{served.address}?frame=1")
    hostile = "<img src=x onerror=document.title=1><b>park</b>"
    say(page, hostile)
    assert page.text_content("#turns .said") == hostile
    assert page.locator("#turns img, #turns b").count() == 0
    assert page.title() != "1"


def test_hovering_reads_the_cell(served: Served, page: Page) -> None:
    opened(page, f"{served.address}?frame=0&source=exact")
    page.mouse.move(*pixel(page, 14.0, -6.0))
    until(page, lambda: "vehicle 100 %" in (page.text_content("#readout") or ""))
    read = page.text_content("#readout") or ""
    assert "14." in read or "13." in read
    assert "to the right" in read
    assert "rgb 245 245 245" in read
    assert "white car" in read
    page.mouse.move(5, 5)
    until(page, lambda: page.text_content("#readout") == "")


def test_a_clicked_vehicle_shows_its_track_until_it_is_let_go(served: Served, page: Page) -> None:
    opened(page, f"{served.address}?frame=2")
    page.mouse.click(*pixel(page, 20.0, 0.0))
    card = page.locator("#vehicle")
    until(page, card.is_visible)
    until(page, lambda: "track" in (card.locator("h2").text_content() or ""))  # tracks come after the map
    assert "black" in (card.text_content() or "")
    assert re.search(r"seen by\s*front", card.text_content() or "")
    page.keyboard.press("ArrowRight")
    at_frame(page, 3)
    assert card.is_visible(), "it is still the same vehicle"
    page.keyboard.press("Escape")
    until(page, card.is_hidden)
    opened(page, f"{served.address}?frame=2&source=exact")
    page.mouse.click(*pixel(page, 20.0, 0.0))
    until(page, lambda: "2.0 m/s (7 km/h)" in (card.text_content() or ""))


def test_layers_go_off_and_on(served: Served, page: Page) -> None:
    opened(page, served.address)
    truth = page.get_by_role("button", name="Truth", exact=True)
    truth.click()
    until(page, page.locator("#truth").is_hidden)
    road = page.get_by_role("button", name="Road", exact=True)
    road.click()
    assert road.get_attribute("aria-pressed") == "true"
    until(page, lambda: "road" in page.url and "truth" not in page.url)


def test_the_map_zooms_and_moves(served: Served, page: Page) -> None:
    opened(page, f"{served.address}?frame=0&source=exact")
    x, y = pixel(page, 0.0, 0.0)
    page.mouse.move(x, y)
    until(page, lambda: "0.0 m" in (page.text_content("#readout") or ""))
    page.mouse.down()
    page.mouse.move(x, y + 60, steps=4)
    page.mouse.up()
    page.mouse.move(x, y)
    until(
        page,
        lambda: (
            "ahead" in (page.text_content("#readout") or "")
            and "0.0 m ahead" not in (page.text_content("#readout") or "")
        ),
    )
    assert page.locator("#vehicle").is_hidden(), "a drag is no click"
    page.mouse.dblclick(x, y)
    page.mouse.move(x + 1, y)
    page.mouse.wheel(0, -1000)
    page.mouse.move(x, y)
    until(page, lambda: "0.0 m" in (page.text_content("#readout") or ""))


def test_escape_leaves_the_text_field_and_then_lets_go_of_the_vehicle(served: Served, page: Page) -> None:
    opened(page, f"{served.address}?frame=1&vehicle=track+1")
    page.keyboard.press("/")
    page.keyboard.type("ar")
    page.keyboard.press("Escape")
    assert page.locator("#vehicle").is_visible()
    assert page.input_value("#sentence") == "ar"
    page.keyboard.press("ArrowRight")
    at_frame(page, 2)
    page.keyboard.press("Escape")
    until(page, page.locator("#vehicle").is_hidden)


def test_keys_zoom_the_map(served: Served, page: Page) -> None:
    opened(page, f"{served.address}?frame=0&source=exact")
    x, y = pixel(page, 20.0, 0.0)
    page.mouse.move(x, y)
    until(page, lambda: "20.0 m ahead" in (page.text_content("#readout") or ""))
    for key in ("+", "+", "-"):
        page.keyboard.press(key)
    page.mouse.move(x + 1, y)
    until(page, lambda: "16.0 m ahead" in (page.text_content("#readout") or ""))
    page.keyboard.press("0")
    page.mouse.move(x, y)
    until(page, lambda: "20.0 m ahead" in (page.text_content("#readout") or ""))


@pytest.mark.parametrize("size", [(1024, 768), (820, 1180), (844, 390), (390, 844)])
def test_every_control_is_in_view_from_the_start(size: tuple[int, int], served: Served, page: Page) -> None:
    page.set_viewport_size({"width": size[0], "height": size[1]})
    opened(page, f"{served.address}?frame=1&vehicle=track+1")
    for control in page.locator("header select, header button, #say input, #say button, footer button").all():
        box = control.bounding_box()
        if box is not None:  # else it is hidden
            name = control.get_attribute("id") or control.text_content()
            assert 0 <= box["x"] < box["x"] + box["width"] <= size[0], name
            assert 0 <= box["y"] < box["y"] + box["height"] <= size[1], name
    say_at, play_at = (page.locator(part).bounding_box() for part in ("#sentence", "#play"))
    assert say_at is not None
    assert play_at is not None
    assert say_at["y"] + say_at["height"] < play_at["y"], "the sentence is not below the time slider"


@pytest.mark.parametrize("size", [(820, 1180), (1180, 820), (400, 800)])
def test_map_and_conversation_are_in_view_together(size: tuple[int, int], served: Served, page: Page) -> None:
    page.set_viewport_size({"width": size[0], "height": size[1]})
    opened(page, f"{served.address}?frame=1")
    say(page, "stop behind the red car")
    for part in ("#map canvas", "#turns .goal", "#sentence", "#play"):
        box = page.locator(part).bounding_box()
        assert box is not None
        assert 0 <= box["x"] < box["x"] + box["width"] <= size[0], part
        assert 0 <= box["y"] < box["y"] + box["height"] <= size[1], part
    canvas = page.locator("#map canvas").bounding_box()
    assert canvas is not None
    assert min(canvas["width"], canvas["height"]) > 150
