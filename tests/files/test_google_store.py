"""Paths in Google Cloud Storage, against a small imitation of its interface on loopback."""

from __future__ import annotations

import json
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread
from urllib.parse import parse_qs, unquote, urlsplit

import pytest
from in_process import run_command

from appocc import files
from appocc.errors import DataError
from appocc.files import store_requests

pytest.importorskip("gcsfs", reason="the extra remote is not installed")


class Bucket(BaseHTTPRequestHandler):
    """The bucket `made`: metadata, contents, lists and simple uploads of its objects."""

    protocol_version = "HTTP/1.1"
    objects: dict[str, bytes]
    refuses = False

    def do_GET(self) -> None:
        """Answer with the metadata or content of an object, or a list."""
        address = urlsplit(self.path)
        place, _, name = address.path.partition("/b/made/o")
        asked = {key: values[0] for key, values in parse_qs(address.query).items()}
        if self.refuses:
            self._answer(403, {"error": {"message": "no right"}})
        elif not place.endswith("/storage/v1"):
            self._answer(404, {})
        elif not name.strip("/"):
            self._answer(200, self._listed(asked.get("prefix", ""), asked.get("delimiter", "")))
        elif (key := unquote(name[1:])) not in self.objects:
            self._answer(404, {})
        elif asked.get("alt") == "media" or "/download/" in place:
            self._answer(200, self.objects[key])
        else:
            self._answer(200, self._about(key))

    def do_POST(self) -> None:
        """Take an object whose metadata and content are parts of the request."""
        body = self.rfile.read(int(self.headers["Content-Length"]))
        mark = body.split(b"\r\n" if b"\r\n" in body.split(b"\n", 1)[0] + b"\n" else b"\n", 1)[0].strip()
        about, content = (part.split(b"\n\n", 1)[1] for part in body.replace(b"\r\n", b"\n").split(mark)[1:3])
        key = str(json.loads(about)["name"])
        self.objects[key] = content.removesuffix(b"\n")
        self._answer(200, self._about(key))

    def do_DELETE(self) -> None:
        """Remove an object."""
        found = self.objects.pop(unquote(self.path.rpartition("/o/")[2].partition("?")[0]), None)
        self._answer(404 if found is None else 200, {})

    def log_message(self, *args: object) -> None:
        """Say nothing."""

    def _about(self, key: str) -> dict[str, object]:
        size, kind = len(self.objects[key]), "storage#object"
        times = {"timeCreated": "2026-01-01T00:00:00.000Z", "updated": "2026-01-01T00:00:00.000Z"}
        return {"kind": kind, "name": key, "bucket": "made", "size": str(size), "etag": f"tag{size}", **times}

    def _listed(self, prefix: str, delimiter: str) -> dict[str, object]:
        below = [key for key in self.objects if key.startswith(prefix)]
        deep = [key for key in below if delimiter and delimiter in key[len(prefix) :]]
        folders = {prefix + key[len(prefix) :].partition(delimiter)[0] + delimiter for key in deep}
        return {"items": [self._about(key) for key in below if key not in deep], "prefixes": sorted(folders)}

    def _answer(self, status: int, value: dict[str, object] | bytes) -> None:
        data = value if isinstance(value, bytes) else json.dumps(value).encode()
        self.send_response(status)
        self.send_header("Content-Type", "application/json")
        self.send_header("Content-Length", str(len(data)))
        self.end_headers()
        self.wfile.write(data)


@pytest.fixture
def bucket(monkeypatch: pytest.MonkeyPatch, new_connections: None) -> Iterator[dict[str, bytes]]:
    """The objects of the bucket gs://made."""
    monkeypatch.setattr(Bucket, "objects", {}, raising=False)
    monkeypatch.setattr(store_requests, "_WAITS_S", (0.01,))
    server = ThreadingHTTPServer(("127.0.0.1", 0), Bucket)
    monkeypatch.setenv("STORAGE_EMULATOR_HOST", f"http://127.0.0.1:{server.server_port}")
    thread = Thread(target=server.serve_forever, daemon=True)
    thread.start()
    yield Bucket.objects
    server.shutdown()
    thread.join(10)
    server.server_close()


def test_objects_are_written_listed_read_and_removed(bucket: dict[str, bytes]) -> None:
    root = files.path_of("gs://made/set")
    files.write_bytes(root / "a b/c.bin", b"12345")
    assert bucket == {"set/a b/c.bin": b"12345"}
    assert files.read_file(root / "a b/c.bin") == b"12345"
    assert [(path.name, path.is_dir()) for path in root.iterdir()] == [("a b", True)]
    assert [str(path) for path in root.rglob("*.bin")] == ["gs://made/set/a b/c.bin"]
    assert (root / "a b/c.bin").stat().st_size == 5
    with pytest.raises(DataError, match=r"gs://made/set/none: cannot be read \(no such file\)"):
        files.read_file(root / "none")
    (root / "a b/c.bin").unlink()
    assert bucket == {}


def test_a_refusal_is_one_line(
    bucket: dict[str, bytes], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Bucket, "refuses", True)
    done = run_command(["doctor", "gs://made/set"], capsys, monkeypatch)
    assert done.returncode == 2
    line = "error: gs://made/set: cannot be read (access denied: expected credentials with the right to it)\n"
    assert done.stderr == line
