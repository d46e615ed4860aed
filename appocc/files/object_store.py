"""Object stores and web servers through fsspec: states, lists, transfers of whole objects.

Credentials and addresses come from the places where the tools of each store look for them (environment, profiles,
`FSSPEC_*` variables). A new process makes its own connections.
"""

from __future__ import annotations

from contextlib import suppress
from datetime import datetime
from email.utils import parsedate_to_datetime
from pathlib import Path
from typing import Any, NamedTuple

from appocc.errors import DataError
from appocc.files.downloads import counted
from appocc.files.store_requests import EmptyObjectError, StoreError, attempt, can_write, connection, scheme_of


class ObjectState(NamedTuple):
    """State of an object in a store.

    Attributes:
        url: URL of the object.
        size: number of bytes; None if a web server does not send it.
        is_folder: whether it is a prefix of object names.
        mark: entity tag (ETag), else the time of the last change; '' if unknown.
        mtime_ns: time of the last change, nanoseconds since 1970; 0 if unknown.
    """

    url: str
    size: int | None
    is_folder: bool
    mark: str
    mtime_ns: int


def state_of_object(url: str) -> ObjectState | None:
    """Ask for an object; None if there is none.

    Raises:
        StoreError: if the store does not answer or refuses.
    """
    try:
        return _state(url, attempt(url, "be read", lambda store, address: store.info(address)))
    except FileNotFoundError:
        return None


def listing(url: str) -> list[ObjectState]:
    """Return the objects and folders in a folder; empty if there is none.

    Raises:
        StoreError: if the store does not answer, refuses, or has no lists.
    """
    if not can_write(url):
        raise StoreError(f"{url}: cannot be listed: a web server has no list of its files")
    try:
        rows = attempt(url, "be listed", lambda store, address: store.ls(address, detail=True))
    except FileNotFoundError:
        return []
    base = url.rstrip("/")
    named = ((str(row["name"]).rstrip("/").rpartition("/")[2], row) for row in rows)
    own = base.rpartition("/")[2]
    # A store may have an empty object that stands for the folder itself.
    return [_state(f"{base}/{name}", row) for name, row in named if name and not _stands_for(row, own, name, base)]


def _stands_for(row: Any, own: str, name: str, base: str) -> bool:
    return name == own and str(row["name"]).rstrip("/") == base.partition("://")[2]


def files_below(url: str) -> list[str]:
    """Return the URLs of all objects below a folder, in order; empty if there is none.

    Raises:
        StoreError: as `listing`.
    """
    if not can_write(url):
        raise StoreError(f"{url}: cannot be listed: a web server has no list of its files")
    base = url.rstrip("/")
    found = attempt(url, "be listed", lambda store, address: store.find(address))
    root = base.partition("://")[2]
    return sorted(f"{base}{str(name).removeprefix(root)}" for name in found if str(name) != root)


def fetch(url: str, most_bytes: int) -> bytes:
    """Read an object.

    Raises:
        FileNotFoundError: if there is none.
        DataError: if it is larger than `most_bytes`.
        StoreError: if the store does not answer or refuses, or its answer ends too early.
    """
    if not can_write(url):  # its server may send the whole file when it is asked for a part
        _check_size(url, state_of_object(url), most_bytes)
        return bytes(attempt(url, "be read", lambda store, address: store.cat_file(address)))
    try:
        data = attempt(url, "be read", lambda store, address: store.cat_file(address, start=0, end=most_bytes + 1))
    except EmptyObjectError:
        return b""
    if len(data) > most_bytes:
        raise DataError(f"{url}: expected at most {most_bytes} bytes, got more")
    return bytes(data)


def download(url: str, state: ObjectState, target: Path) -> None:
    """Copy an object to a local file; its progress is shown, see `show_downloads`.

    Raises:
        FileNotFoundError: if there is none.
        StoreError: if the store does not answer or refuses, or sends another number of bytes than it said.
        OSError: if the local file cannot be written.
    """

    def copy(store: Any, address: str) -> None:
        target.write_bytes(b"")  # so that an error of the local disk is one
        with counted(url, state.size) as callback:
            store.get_file(address, str(target), **callback)
        got = target.stat().st_size
        if state.size is not None and got != state.size:
            raise ConnectionError(f"expected {state.size} bytes, got {got}")

    attempt(url, "be read", copy)


def upload(source: Path, url: str) -> None:
    """Copy a local file to an object, which is there as a whole or not at all.

    Raises:
        DataError: if its store is read-only.
        StoreError: if the store does not answer or refuses.
    """
    check_writable(url)
    # Of parts sent side by side, some would still arrive after one has failed and the upload is aborted.
    one_by_one = {"max_concurrency": 1} if scheme_of(url) == "s3" else {}
    try:
        attempt(url, "be written", lambda store, address: store.put_file(str(source), address, **one_by_one))
    except FileNotFoundError as error:
        raise StoreError(f"{url}: cannot be written (no such bucket)") from error
    except (KeyboardInterrupt, SystemExit):
        _abort_parts(url)
        raise


def _abort_parts(url: str) -> None:
    """Remove the parts of an interrupted upload, which a bucket keeps and bills; s3fs does it after errors only."""
    if scheme_of(url) != "s3":
        return
    bucket, _, key = url.partition("://")[2].partition("/")
    store = connection("s3")
    with suppress(Exception):  # the interruption is what counts
        found = store.call_s3("list_multipart_uploads", Bucket=bucket, Prefix=key).get("Uploads", [])
        for each in found:
            if each["Key"] == key:
                store.call_s3("abort_multipart_upload", Bucket=bucket, Key=key, UploadId=each["UploadId"])


def remove(url: str) -> None:
    """Remove an object; without effect if there is none.

    Raises:
        DataError: if its store is read-only.
        StoreError: if the store does not answer or refuses.
    """
    check_writable(url)
    try:
        attempt(url, "be removed", lambda store, address: store.rm_file(address))
    except FileNotFoundError:
        return


def check_writable(url: str) -> None:
    """Check that a URL can be written.

    Raises:
        DataError: if it is that of a web server.
    """
    if not can_write(url):
        raise DataError(f"{url}: cannot be written: a web server is read-only; expected s3:// or gs://")


def _check_size(url: str, state: ObjectState | None, most_bytes: int) -> None:
    if state is None:
        raise FileNotFoundError(url)
    if state.size is not None and state.size > most_bytes:
        raise DataError(f"{url}: expected at most {most_bytes} bytes, got {state.size}")


def _state(url: str, row: Any) -> ObjectState:
    time_of = row.get("LastModified") or row.get("Last-Modified") or row.get("updated") or row.get("mtime")
    moment = _moment(time_of)
    mark = row.get("ETag") or row.get("etag") or (f"{moment.timestamp()}" if moment else "")
    mtime_ns = int(moment.timestamp() * 1e9) if moment else 0
    return ObjectState(url, row.get("size"), row.get("type") == "directory", str(mark).strip('"'), mtime_ns)


def _moment(value: Any) -> datetime | None:
    """Return a time that a store states, in any of the usual forms; None if it is none."""
    if not isinstance(value, str):
        return value if isinstance(value, datetime) else None
    for parse in (datetime.fromisoformat, parsedate_to_datetime):
        try:
            return parse(value)
        except ValueError:
            continue
    return None
