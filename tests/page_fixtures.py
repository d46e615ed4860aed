"""The page of a made recording, without a browser: one for the tests of a file."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from made_recording import write_recording
from starlette.testclient import TestClient

from cli.server.app import build_app
from cli.server.library import Library

FRAMES = 4


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_recording(tmp_path_factory.mktemp("opened") / "made", FRAMES)


@pytest.fixture(scope="module")
def client(root: Path) -> Iterator[TestClient]:
    with TestClient(build_app(Library([root])), base_url="http://127.0.0.1:8040") as client:
        yield client


@pytest.fixture(scope="module")
def at(client: TestClient) -> str:
    """Address of the scene of the recording."""
    return f"/api/recordings/{client.get('/api/recordings').json()['recordings'][0]['key']}/0"
