"""Requests to stores that fail: they are repeated, or end in one line that names the URL and no secret."""

from __future__ import annotations

import socket
from pathlib import Path
from typing import Any

import pytest
from in_process import run_command
from s3_server import SECRET, Fault, S3Server
from tiny_dataset import TinyDataset

from appocc import files
from appocc.errors import DataError
from appocc.files import store_requests
from appocc.files.store_requests import StoreError


def failing(times: int, status: str, body: bytes = b"", method: str = "", headers: tuple[Any, ...] = ()) -> Fault:
    """Answer the first requests of a method with an error."""
    left = [times]

    def fault(environ: dict[str, Any]) -> tuple[str, list[tuple[str, str]], bytes] | None:
        if left[0] == 0 or method not in ("", environ["REQUEST_METHOD"]):
            return None
        left[0] -= 1
        own = list(headers) or [("Content-Length", str(len(body)))]
        return status, own, b"" if environ["REQUEST_METHOD"] == "HEAD" else body

    return fault


SLOW_DOWN = b"<Error><Code>SlowDown</Code><Message>Please reduce your request rate.</Message></Error>"


@pytest.fixture
def bucket(s3: S3Server) -> str:
    s3.client().create_bucket(Bucket="made")
    return "s3://made"


def test_a_throttled_request_is_repeated(s3: S3Server, bucket: str) -> None:
    s3.faults.append(failing(2, "503 Slow Down", SLOW_DOWN))
    files.write_bytes(f"{bucket}/a/b.bin", b"12345")
    s3.faults[:] = [failing(3, "503 Slow Down", SLOW_DOWN)]
    assert files.read_file(f"{bucket}/a/b.bin") == b"12345"


def test_attempts_are_bounded(s3: S3Server, bucket: str) -> None:
    s3.faults.append(failing(99, "503 Slow Down", SLOW_DOWN))
    s3.requests.clear()
    line = r"s3://made/a\.bin: cannot be written \(the store is overloaded: 503, after 4 attempts\)"
    with pytest.raises(StoreError, match=line):
        files.write_bytes(f"{bucket}/a.bin", b"1")
    assert s3.requests == ["PUT /made/a.bin"] * 4
    s3.faults.clear()
    assert not s3.contents("made")


def test_an_answer_that_ends_too_early_is_asked_for_again(s3: S3Server, bucket: str) -> None:
    files.write_bytes(f"{bucket}/a.bin", b"12345")
    cut = failing(1, "200 OK", b"123", "GET", (("Content-Length", "5"), ("Connection", "close")))
    s3.faults.append(cut)
    assert files.read_file(f"{bucket}/a.bin") == b"12345"
    s3.faults[:] = [failing(99, "200 OK", b"123", "GET", (("Content-Length", "5"), ("Connection", "close")))]
    with pytest.raises(
        StoreError, match=r"s3://made/a\.bin: cannot be read \(the answer ends too early, after 4 att"
    ):
        files.read_file(f"{bucket}/a.bin")


@pytest.mark.usefixtures("new_connections")
def test_a_lost_store_is_no_missing_file(s3: S3Server, bucket: str, monkeypatch: pytest.MonkeyPatch) -> None:
    with socket.socket() as unused:
        unused.bind(("127.0.0.1", 0))
        monkeypatch.setenv("AWS_ENDPOINT_URL", f"http://127.0.0.1:{unused.getsockname()[1]}")
        with pytest.raises(StoreError, match=r"s3://made/a: cannot be read \(.*after 4 attempts\)"):
            files.path_of(f"{bucket}/a").is_file()
    assert not issubclass(StoreError, DataError | OSError)  # what leaves out missing files must not see it


def test_wrong_credentials_end_the_command_at_once(
    s3: S3Server,
    tiny: TinyDataset,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    root = s3.put(tiny.root, "data")
    s3.faults.append(failing(99, "403 Forbidden", b"<Error><Code>InvalidAccessKeyId</Code></Error>"))
    s3.requests.clear()
    done = run_command(["doctor", root], capsys, monkeypatch)
    assert done.returncode == 2
    line = "error: s3://data: cannot be read (access denied: expected credentials with the right to it)"
    assert done.stderr.splitlines() == [line]
    assert len(s3.requests) == 1
    assert SECRET not in done.stderr


@pytest.mark.usefixtures("new_connections")
def test_no_credentials(
    s3: S3Server, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"):
        monkeypatch.delenv(name)
    monkeypatch.setenv("AWS_EC2_METADATA_DISABLED", "true")
    monkeypatch.setenv("AWS_SHARED_CREDENTIALS_FILE", str(tmp_path / "none"))
    done = run_command(["doctor", "s3://data"], capsys, monkeypatch)
    assert done.returncode == 2
    assert done.stderr == "error: s3://data: cannot be read (Unable to locate credentials)\n"


def test_a_bucket_that_is_not_there(s3: S3Server) -> None:
    with pytest.raises(StoreError, match=r"s3://none/a: cannot be read \(no such bucket\)"):
        files.read_file("s3://none/a")
    with pytest.raises(StoreError, match=r"s3://none/a: cannot be written \(no such bucket\)"):
        files.write_bytes("s3://none/a", b"1")


def test_a_missing_object(s3: S3Server, bucket: str) -> None:
    for read in (files.read_file, files.read_json, files.read_image, files.digest_of):
        with pytest.raises(DataError, match=r"^s3://made/a\.json: cannot be read \(no such file\)$"):
            read(f"{bucket}/a.json")


def test_sizes_are_bounded_before_bytes_are_read(s3: S3Server, bucket: str) -> None:
    files.write_bytes(f"{bucket}/a.json", b"123456")
    assert files.read_file(f"{bucket}/a.json", 6) == b"123456"
    with pytest.raises(DataError, match=r"s3://made/a\.json: expected at most 5 bytes, got more"):
        files.read_file(f"{bucket}/a.json", 5)
    with (
        pytest.raises(DataError, match=r"s3://made/a\.json: expected at most 5 bytes, got 6"),
        files.open_plain(f"{bucket}/a.json", 5),
    ):
        pass


def test_an_empty_object(s3: S3Server, bucket: str) -> None:
    files.write_bytes(f"{bucket}/a", b"")
    assert files.read_file(f"{bucket}/a") == b""
    with pytest.raises(DataError, match="s3://made/a: no valid JSON"):
        files.read_json(f"{bucket}/a")


def test_a_write_that_fails_leaves_what_was_there(s3: S3Server, bucket: str) -> None:
    files.write_bytes(f"{bucket}/a.bin", b"old")

    def write_half() -> None:
        with files.whole_file(f"{bucket}/a.bin") as path:
            path.write_bytes(b"half")
            raise RuntimeError

    with pytest.raises(RuntimeError):
        write_half()
    assert s3.contents("made") == {"a.bin": b"old"}


def test_parts_of_a_large_write_that_fails_are_removed(
    s3: S3Server, bucket: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("s3fs.core.calculate_chunksize", lambda size, **_: 5 << 20)
    last = failing(99, "403 Forbidden", b"<Error><Code>AccessDenied</Code></Error>", "PUT")
    s3.faults.append(lambda environ: last(environ) if "partNumber=3" in environ["QUERY_STRING"] else None)
    with pytest.raises(StoreError, match=r"s3://made/large\.bin: cannot be written \(access denied"):
        files.write_bytes(f"{bucket}/large.bin", bytes(11 << 20))
    assert "Uploads" not in s3.client().list_multipart_uploads(Bucket="made")
    s3.faults.clear()
    assert not s3.contents("made")
    files.write_bytes(f"{bucket}/large.bin", bytes(11 << 20))
    assert s3.client().head_object(Bucket="made", Key="large.bin")["ContentLength"] == 11 << 20


def test_parts_of_an_interrupted_write_are_removed(
    s3: S3Server, bucket: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = store_requests.connection("s3")

    def interrupted(source: str, address: str, **options: int) -> None:
        store.call_s3("create_multipart_upload", Bucket="made", Key="large.bin")
        raise KeyboardInterrupt

    monkeypatch.setattr(store, "put_file", interrupted)
    other = s3.client().create_multipart_upload(Bucket="made", Key="large.bin.other")["UploadId"]
    with pytest.raises(KeyboardInterrupt):
        files.write_bytes(f"{bucket}/large.bin", b"1")
    left = s3.client().list_multipart_uploads(Bucket="made")["Uploads"]
    assert [each["UploadId"] for each in left] == [other]
