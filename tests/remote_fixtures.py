"""An S3 server for all tests of a process, and the environment that leads to it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from s3_server import KEY, SECRET, S3Server, s3_server

from appocc.files import object_store


@pytest.fixture(scope="session")
def _server() -> Iterator[S3Server]:
    pytest.importorskip("s3fs", reason="the extra remote is not installed")
    with s3_server() as server:
        yield server
    object_store.forget_stores()


@pytest.fixture
def s3(_server: S3Server, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[S3Server]:
    """An empty S3 server; the credentials in the environment are right, waits are short, the cache is empty."""
    for name, value in {
        "AWS_ACCESS_KEY_ID": KEY,
        "AWS_SECRET_ACCESS_KEY": SECRET,
        "AWS_DEFAULT_REGION": "us-east-1",
        "AWS_ENDPOINT_URL": _server.url,
        "APPOCC_CACHE": str(tmp_path / "cache"),
    }.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setattr(object_store, "_WAITS_S", (0.01, 0.01, 0.01))
    yield _server
    _server.reset()


@pytest.fixture
def new_connections() -> Iterator[None]:
    """For tests that change the environment of connections: these are made anew, before and after."""
    object_store.forget_stores()
    yield
    object_store.forget_stores()
