"""The page in a headless browser: open, play, ask, be asked, choose, hover, click, load again, lose the server."""

from __future__ import annotations

import re
import socket
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from browser import open_browser
from made_recording import SCENE, write_recording

from cli.server.app import build_app
from cli.server.library import Library
from cli.server.running import bound_socket, build_server

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

FRAMES = 6
# Only ends a hang: the machine may be busy.
_PATIENCE_MS = 60_000


class Served:
    """The page on a free port, which can be taken away and brought back."""

    def __init__(self, root: Path) -> None:
        self.root, self.port = root, 0
        self.start()

    def start(self) -> None:
        bound = bound_socket("127.0.0.1", self.port)
        self.port = bound.getsockname()[1]
        self._server = build_server(build_app(Library([self.root])))
        self._thread = threading.Thread(target=self._server.run, kwargs={"sockets": [bound]})
        self._thread.start()

    def stop(self) -> None:
        self._server.should_exit = True
        self._thread.join()

    @property
    def address(self) -> str:
        return f"http://127.0.0.1:{self.port}/"


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    served = Served(write_recording(tmp_path_factory.mktemp("page") / "made", FRAMES))
    yield served
    served.stop()


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with open_browser() as browser:
        yield browser


@pytest.fixture
def page(browser: Browser) -> Iterator[Page]:
    """An empty page; at the end, nothing may have gone wrong in it or have been asked of another host."""
    context = browser.new_context(viewport={"width": 1280, "height": 800})
    context.set_default_timeout(_PATIENCE_MS)
    page = context.new_page()
    faults: list[str] = []
    page.on("pageerror", lambda error: faults.append(str(error)))
    page.on("request", lambda request: faults.append(request.url) if "//127.0.0.1:" not in request.url else None)
    page.on("console", lambda line: faults.append(line.text) if "Content Security" in line.text else None)
    yield page
    context.close()
    assert [fault for fault in faults if not fault.startswith("blob:")] == []


def opened(page: Page, address: str) -> Page:
    page.goto(address)
    page.wait_for_selector("body[data-ready]")
    until(page, lambda: page.text_content("#clock") != "")  # no wait_for_function: the policy forbids eval
    return page


def until(page: Page, found: Callable[[], bool]) -> None:
    """Wait for something that the page shows."""
    limit = time.monotonic() + _PATIENCE_MS / 1000
    while not found():
        assert time.monotonic() < limit, page.content()
        page.wait_for_timeout(50)


def at_frame(page: Page, frame: int) -> None:
    until(page, lambda: f"frame {frame} of" in (page.text_content("#clock") or ""))


def say(page: Page, text: str) -> None:
    turns = page.locator("#turns .answer").count()
    page.fill("#sentence", text)
    page.press("#sentence", "Enter")
    until(page, lambda: page.locator("#turns .answer").count() > turns)


def drawn(page: Page, colour: str) -> int:
    """The number of pixels of the map that have a colour: a condition on r, g and b."""
    count = f"""() => {{
      const canvas = document.querySelector('#map canvas');
      const {{ data }} = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
      const matches = ([r, g, b]) => {colour};
      let count = 0;
      for (let at = 0; at < data.length; at += 4) count += matches([...data.subarray(at, at + 3)]) ? 1 : 0;
      return count;
    }}"""
    return int(page.evaluate(count))


def pixel(page: Page, x_m: float, y_m: float, figure: str = "#map") -> tuple[float, float]:
    """The place of a point of the ground in the page, by the circles of the map: the ego is in the middle."""
    box = page.locator(f"{figure} canvas").bounding_box()
    assert box is not None
    fits = [box["height"] / 80, box["width"] / 80]
    scale = min(max(fits), 1.3 * min(fits))
    return box["x"] + box["width"] / 2 - y_m * scale, box["y"] + box["height"] / 2 - x_m * scale


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
    assert "track" in (card.locator("h2").text_content() or "")
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


def test_a_page_that_is_loaded_again_shows_the_same(served: Served, page: Page) -> None:
    opened(page, f"{served.address}?frame=1")
    say(page, "stop behind the white car")
    page.get_by_role("button", name="Lane", exact=True).click()
    page.keyboard.press("ArrowRight")
    at_frame(page, 2)
    until(page, lambda: "frame=2" in page.url and "lane" in page.url and "talk=" in page.url)
    before = page.text_content("#turns")
    page.reload()
    opened(page, page.url)
    at_frame(page, 2)
    assert page.text_content("#turns") == before
    assert page.locator("#replies .choice").count() == 2
    assert page.get_by_role("button", name="Lane", exact=True).get_attribute("aria-pressed") == "true"


def test_a_lost_connection_is_told_and_comes_back(tmp_path: Path, page: Page) -> None:
    served = Served(write_recording(tmp_path / "made", 3))
    try:
        opened(page, served.address)
        served.stop()
        page.fill("#sentence", "stop behind the red car")
        page.press("#sentence", "Enter")
        until(page, page.locator("#banner").is_visible)
        assert "lost" in (page.text_content("#banner") or "")
        served.start()
        until(page, page.locator("#banner").is_hidden)
        page.press("#sentence", "Enter")  # the sentence is still there
        until(page, lambda: page.locator("#turns .answer:not(.problem)").count() == 1)
    finally:
        served.stop()


def test_a_damaged_picture_and_a_missing_map_are_told_plainly(tmp_path: Path, page: Page) -> None:
    root = write_recording(tmp_path / "made", 2)
    (root / "samples" / "CAM_BACK" / "0.jpg").write_bytes(b"\xff\xd8 no image")
    for source in ("predicted", "exact"):
        next(iter(sorted((root / "bev" / source).glob("*.npz")))).unlink()
    served = Served(root)
    try:
        for frame in (0, 1):
            opened(page, f"{served.address}?frame={frame}")
        page.goto(f"{served.address}?frame=0")
        until(page, lambda: page.locator(".camera.missing").count() == 1)
        assert "Traceback" not in page.content()
    finally:
        served.stop()


def test_a_slow_client_holds_up_nobody(served: Served, page: Page) -> None:
    with socket.create_connection(("127.0.0.1", served.port)) as slow:
        slow.sendall(b"POST /api/talk HTTP/1.1\r\nHost: localhost\r\nContent-Length: 100\r\n")
        opened(page, f"{served.address}?frame=1")
        say(page, "stop behind the red car")
        slow.sendall(b"Content-Type: application/json\r\n\r\n{")


def test_several_pages_have_their_own_conversations(served: Served, browser: Browser, page: Page) -> None:
    other = browser.new_page()
    try:
        opened(page, f"{served.address}?frame=1")
        opened(other, f"{served.address}?frame=1")
        say(page, "stop behind the red car")
        say(other, "stop behind the white car")
        assert page.locator("#turns .said").all_text_contents() == ["stop behind the red car"]
        assert other.locator("#turns .said").all_text_contents() == ["stop behind the white car"]
    finally:
        other.close()


def test_an_empty_folder_offers_a_drive(tmp_path: Path, page: Page) -> None:
    served = Served(tmp_path)
    try:
        page.goto(served.address)
        page.wait_for_selector("body[data-ready]")
        assert "New drive" in (page.text_content("#note") or "")
        page.click("#new-drive")
        assert page.locator("dialog select[name=town] option").count() == 8
        page.keyboard.press("Escape")
        assert page.locator("dialog[open]").count() == 0
        page.click("#new-drive")
        page.get_by_role("button", name="Start").click()
        until(page, lambda: "Simulating harrowmere" in (page.text_content("#job") or ""))
        until(page, lambda: "being made" in (page.text_content("#note") or ""))
        assert page.evaluate("document.documentElement.scrollWidth <= window.innerWidth"), "the page keeps its width"
        page.get_by_role("button", name="Stop").click()
        until(page, lambda: "stopped" in (page.text_content("#job") or ""))
        until(page, lambda: "Nothing is open" in (page.text_content("#note") or ""))
    finally:
        served.stop()


def test_the_first_drive_opens_by_itself(tmp_path: Path, page: Page) -> None:
    job = {"number": 1, "kind": "simulate", "title": "a drive", "state": "running", "done": 0, "total": 1}
    job |= {"note": "", "seconds": 1.0, "recording": None, "source": "predicted"}
    page.route("**/api/jobs", lambda route: route.fulfill(json={"jobs": [job]}))
    served = Served(tmp_path)
    try:
        page.goto(served.address)
        until(page, lambda: "being made" in (page.text_content("#note") or ""))
        write_recording(tmp_path / "made", 2)
        listed = page.request.get(f"{served.address}api/recordings").json()
        job |= {"state": "done", "recording": listed["recordings"][0]["key"]}
        at_frame(page, 0)
        assert page.text_content("#map figcaption") == "predicted"
    finally:
        served.stop()
