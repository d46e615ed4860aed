"""Datasets on a web server: read by the names in their tables."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread

import numpy as np
import pytest
from in_process import run_command
from tiny_dataset import TinyDataset

from appocc import Dataset, files
from appocc.errors import DataError
from appocc.files import store_requests
from appocc.files.store_requests import StoreError

pytest.importorskip("aiohttp", reason="the extra remote is not installed")


class Quiet(SimpleHTTPRequestHandler):
    protocol_version = "HTTP/1.1"

    def log_message(self, *args: object) -> None:
        """Say nothing."""


@pytest.fixture
def served(tiny: TinyDataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """The tiny dataset at an address."""
    monkeypatch.setenv("APPOCC_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(store_requests, "_WAITS_S", (0.01, 0.01, 0.01))
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=str(tmp_path)))
    thread = Thread(target=server.serve_forever, daemon=True)
    thread.start()
    yield f"http://127.0.0.1:{server.server_port}/{tiny.root.name}"
    store_requests.forget_stores()
    server.shutdown()
    thread.join(10)
    server.server_close()


def test_a_dataset_is_read_by_its_tables(
    served: str, tiny: TinyDataset, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    remote, local = Dataset(served, tiny.version), Dataset(tiny.root)
    samples = remote.samples(remote.scenes[0])
    assert samples == local.samples(local.scenes[0])
    own, other = (each.frame(samples[0]) for each in (remote, local))
    for channel, image in other.images.items():
        assert np.array_equal(own.images[channel], image)
    done = run_command(["doctor", served, "--version", tiny.version], capsys, monkeypatch)
    assert done.returncode == 0, done.stderr


def test_its_version_must_be_named_unless_it_is_a_usual_one(served: str, tiny: TinyDataset) -> None:
    with pytest.raises(DataError, match=r"a web server has no list of its files: name theirs with --version"):
        Dataset(served)
    (tiny.root / tiny.version).rename(tiny.root / "v1.0-mini")
    assert Dataset(served).tables.version == "v1.0-mini"


def test_it_is_read_only_and_has_no_lists(
    served: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(StoreError, match=r"/tiny: cannot be listed: a web server has no list of its files"):
        next(files.path_of(served).iterdir())
    with pytest.raises(DataError, match=r"a\.bin: cannot be written: a web server is read-only"):
        files.write_bytes(f"{served}/a.bin", b"1")
    done = run_command(["infer", served, "--out", f"{served}/bev/mine"], capsys, monkeypatch)
    assert done.returncode == 2
    assert "read-only" in done.stderr


def test_sizes_are_bounded_and_names_are_quoted(served: str, tiny: TinyDataset) -> None:
    for name in ("a b#c%20d?e.json", "%2e%2e"):
        (tiny.root / name).write_text("[1]")
        assert files.read_json(files.path_of(served) / name) == [1]
    with pytest.raises(DataError, match="expected at most 2 bytes, got 3"):
        files.read_file(files.path_of(served) / "%2e%2e", 2)
    assert files.path_of(f"{served}/a%20b") == files.path_of(f"{served}/a b")


def test_an_answer_of_another_size_than_said_is_no_file(served: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Quiet, "end_headers", _with_a_byte_too_many(Quiet.end_headers))
    with pytest.raises(StoreError, match="after 4 attempts"):
        files.read_file(f"{served}/v1.0-tiny/log.json")


def _with_a_byte_too_many(end_headers: object) -> object:
    def cut(self: Quiet) -> None:
        self._headers_buffer = [  # type: ignore[attr-defined]
            b"Content-Length: 999999\r\n" if line.lower().startswith(b"content-length") else line
            for line in self._headers_buffer  # type: ignore[attr-defined]
        ]
        self.close_connection = True
        SimpleHTTPRequestHandler.end_headers(self)

    return cut


def test_no_server(served: str) -> None:
    with pytest.raises(StoreError, match=r"http://127\.0\.0\.1:1/x: cannot be read \(.*, after 4 attempts\)"):
        files.read_file("http://127.0.0.1:1/x")
