"""An S3 server on loopback (moto) that can be told to fail."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from threading import Thread
from typing import Any
from urllib.request import Request, urlopen

# A request as WSGI has it -> the status line and headers to answer with, and the body; None: let the server answer.
Fault = Callable[[dict[str, Any]], tuple[str, list[tuple[str, str]], bytes] | None]
KEY, SECRET = "appocc-key", "appocc-secret-that-no-message-shows"


class S3Server:
    """Buckets in memory, the requests that came, and the faults that come before the answers."""

    def __init__(self) -> None:
        """Begin without faults."""
        from moto.moto_server.werkzeug_app import DomainDispatcherApplication, create_backend_app

        self._app = DomainDispatcherApplication(create_backend_app)
        self.faults: list[Fault] = []
        self.requests: list[str] = []
        self.url = ""

    def __call__(self, environ: dict[str, Any], start: Any) -> Iterable[bytes]:
        """Answer a request."""
        self.requests.append(f"{environ['REQUEST_METHOD']} {environ['PATH_INFO']}")
        for fault in self.faults:
            answer = fault(environ)
            if answer is not None:
                status, headers, body = answer
                start(status, headers)
                return [body]
        found: Iterable[bytes] = self._app(environ, start)
        return found

    def put(self, folder: Path, bucket: str) -> str:
        """Copy the files of a folder into a new bucket; its URL."""
        client = self.client()
        client.create_bucket(Bucket=bucket)
        for path in sorted(folder.rglob("*")):
            if path.is_file():
                client.put_object(Bucket=bucket, Key=path.relative_to(folder).as_posix(), Body=path.read_bytes())
        return f"s3://{bucket}"

    def contents(self, bucket: str, prefix: str = "") -> dict[str, bytes]:
        """The objects of a bucket below a prefix, by name."""
        client = self.client()
        pages = client.get_paginator("list_objects_v2").paginate(Bucket=bucket, Prefix=prefix)
        keys = [row["Key"] for page in pages for row in page.get("Contents", [])]
        return {key: client.get_object(Bucket=bucket, Key=key)["Body"].read() for key in keys}

    def reset(self) -> None:
        """Remove all buckets, and the faults."""
        self.faults.clear()
        with urlopen(Request(f"{self.url}/moto-api/reset", method="POST")) as answer:
            answer.read()
        self.requests.clear()

    @cache  # noqa: B019 - a server lives as long as the tests
    def client(self) -> Any:
        """A client of the server."""
        import boto3  # type: ignore[import-untyped]

        return boto3.client(
            "s3", "us-east-1", endpoint_url=self.url, aws_access_key_id=KEY, aws_secret_access_key=SECRET
        )


@contextmanager
def s3_server() -> Iterator[S3Server]:
    """Serve on a free port of loopback."""
    from werkzeug.serving import WSGIRequestHandler, make_server

    class Quiet(WSGIRequestHandler):
        protocol_version = "HTTP/1.1"

        def log(self, *args: object, **more: object) -> None:
            """Say nothing."""

    app = S3Server()
    server = make_server("127.0.0.1", 0, app, threaded=True, request_handler=Quiet)
    app.url = f"http://127.0.0.1:{server.server_port}"
    thread = Thread(target=server.serve_forever, daemon=True)
    thread.start()
    try:
        yield app
    finally:
        server.shutdown()
        thread.join(10)
        server.server_close()
