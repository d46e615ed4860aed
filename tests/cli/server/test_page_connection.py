"""The page in a headless browser: loaded again, without a server, damaged files, several pages, a first drive."""

from __future__ import annotations

import socket
from pathlib import Path
from typing import TYPE_CHECKING

from made_recording import write_recording
from served_page import Served, at_frame, opened, say, until

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page


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
