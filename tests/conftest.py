"""Shared fixtures: the recorded data beside the repository, a tiny dataset, an S3 server, the page in a browser."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from browser import open_browser
from hypothesis import HealthCheck, settings
from made_recording import write_recording
from s3_server import KEY, SECRET, S3Server, s3_server
from served_page import FRAMES, PATIENCE_MS, Served
from tiny_dataset import TinyDataset
from walkthrough import Walkthrough, run_walkthrough

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

# The same examples on every run, and no limit of time: the machine may be busy.
settings.register_profile("steady", derandomize=True, deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("steady")

# Fixtures that take long and are made once for all processes of a run.
_MADE_ONCE = ("walkthrough", "simulated")


def pytest_configure(config: pytest.Config) -> None:
    """Where there is a process a core, threads within each would only wait for each other."""
    if config.getoption("numprocesses", default=None):
        for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
            os.environ.setdefault(name, "1")


@pytest.hookimpl(trylast=True)  # of the tests that are chosen
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """What is made once is begun first, a file for each, and its other users come last: no process waits for it."""
    makers = {name: next((item.path for item in items if _needs(item) == {name}), None) for name in _MADE_ONCE}
    users = {item.path for item in items if _needs(item)}
    items.sort(key=lambda item: 0 if item.path in makers.values() else 1 + (item.path in users))


def _needs(item: pytest.Item) -> set[str]:
    """Which of those an item needs."""
    return set(_MADE_ONCE).intersection(getattr(item, "fixturenames", ()))


@pytest.fixture(scope="session")
def data_root() -> Path:
    """Folder of the recorded data (`$APPOCC_DATA`, or ../shared/data beside the repository); skips where absent."""
    named = os.environ.get("APPOCC_DATA")
    root = Path(named) if named else Path(__file__).parents[2] / "shared" / "data"
    if not root.is_dir():
        pytest.skip(f"no recorded data at {root}; set APPOCC_DATA to its folder")
    return root


@pytest.fixture
def tiny(tmp_path: Path) -> TinyDataset:
    """A dataset of one scene in a folder of its own; change `tables`, then `write`."""
    return TinyDataset(tmp_path / "tiny")


@pytest.fixture
def tiny_root(tiny: TinyDataset) -> Path:
    """The root of that dataset."""
    return tiny.root


@pytest.fixture(scope="session")
def walkthrough(data_root: Path, tmp_path_factory: pytest.TempPathFactory) -> Walkthrough:
    """The README's lines on a real street, run once for all tests, in all processes of a run; read only."""
    return run_walkthrough(_shared_folder(tmp_path_factory) / "walkthrough", "## On a real street", data_root)


@pytest.fixture(scope="session")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> Walkthrough:
    """The README's lines in a simulated town, run once for all tests, in all processes of a run; read only."""
    return run_walkthrough(_shared_folder(tmp_path_factory) / "simulated", "## In a simulated town", None)


@pytest.fixture(scope="session")
def simulated_root(simulated: Walkthrough) -> Path:
    """The simulated dataset: all eight towns, a few frames each; read only."""
    assert simulated.outcomes[0][0] == 0, simulated.failures()
    return simulated.folder / "SIM"


def _shared_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder that all test processes of a run share."""
    base = tmp_path_factory.getbasetemp()
    return base.parent if "PYTEST_XDIST_WORKER" in os.environ else base


@pytest.fixture(scope="session")
def panda_root(walkthrough: Walkthrough) -> Path:
    """The recorded street (PandaSet 002) as the walkthrough converted it, with its maps; read only."""
    assert [code for code, _ in walkthrough.outcomes[:2]] == [0, 0], walkthrough.failures()
    return walkthrough.folder / "OUT"


@pytest.fixture(scope="session")
def _server() -> Iterator[S3Server]:
    pytest.importorskip("s3fs", reason="the extra remote is not installed")
    from appocc.files import store_requests

    with s3_server() as server:
        yield server
    store_requests.forget_stores()


@pytest.fixture
def s3(_server: S3Server, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[S3Server]:
    """An empty S3 server; the credentials in the environment are right, waits are short, the cache is empty."""
    from appocc.files import store_requests

    for name, value in {
        "AWS_ACCESS_KEY_ID": KEY,
        "AWS_SECRET_ACCESS_KEY": SECRET,
        "AWS_DEFAULT_REGION": "us-east-1",
        "AWS_ENDPOINT_URL": _server.url,
        "APPOCC_CACHE": str(tmp_path / "cache"),
    }.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setattr(store_requests, "_WAITS_S", (0.01, 0.01, 0.01))
    yield _server
    _server.reset()


@pytest.fixture
def new_connections() -> Iterator[None]:
    """For tests that change the environment of connections: these are made anew, before and after."""
    from appocc.files import store_requests

    store_requests.forget_stores()
    yield
    store_requests.forget_stores()


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
    context.set_default_timeout(PATIENCE_MS)
    page = context.new_page()
    faults: list[str] = []
    page.on("pageerror", lambda error: faults.append(str(error)))
    page.on("request", lambda request: faults.append(request.url) if "//127.0.0.1:" not in request.url else None)
    page.on("console", lambda line: faults.append(line.text) if "Content Security" in line.text else None)
    yield page
    context.close()
    assert [fault for fault in faults if not fault.startswith("blob:")] == []
