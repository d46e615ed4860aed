"""The page of a made recording on a free port, and what a person does with it in a browser."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from cli.server.app import build_app
from cli.server.library import Library
from cli.server.running import bound_socket, build_server

if TYPE_CHECKING:
    from playwright.sync_api import Page

FRAMES = 6
# Only ends a hang: the machine may be busy.
PATIENCE_MS = 60_000


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


def opened(page: Page, address: str) -> Page:
    page.goto(address)
    page.wait_for_selector("body[data-ready]")
    until(page, lambda: page.text_content("#clock") != "")  # no wait_for_function: the policy forbids eval
    return page


def until(page: Page, found: Callable[[], bool]) -> None:
    """Wait for something that the page shows."""
    limit = time.monotonic() + PATIENCE_MS / 1000
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
