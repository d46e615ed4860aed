"""Object stores and web servers through fsspec: requests that are repeated a few times, and errors in one line.

Credentials and addresses come from the places where the tools of each store look for them (environment, profiles,
`FSSPEC_*` variables). A new process makes its own connections.
"""

from __future__ import annotations

import logging
import os
import random
import re
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from datetime import datetime
from email.utils import parsedate_to_datetime
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple, TypeVar
from urllib.parse import quote

from appocc.errors import AppoccError, DataError
from appocc.extras import import_extra

T = TypeVar("T")

# Stores by scheme: the module that fsspec needs, and options for it.
_WEB = ("http", "https")
_TIMEOUTS_S = {"connect_timeout": 10, "read_timeout": 60}
_MODULES = {"s3": "s3fs", "gs": "gcsfs", "http": "aiohttp", "https": "aiohttp"}
SCHEMES = tuple(_MODULES)
# Waits before the attempts after the first one, in seconds, each shortened by chance: several processes that a store
# has turned away do not come back at the same moment.
_WAITS_S = (0.5, 1.0, 2.0, 4.0, 8.0)
# Clients that repeat requests by themselves, and how often; the attempts of the others are switched off.
_OWN_ATTEMPTS = {"gs": 6}
_DENIED, _MISSING, _OVERLOADED = (401, 403), (404, 410), (429, 503)
# Errors of a client before it sends anything: a further attempt ends the same way.
_HOPELESS = (
    "NoCredentialsError",
    "PartialCredentialsError",
    "CredentialRetrievalError",
    "ProfileNotFound",
    "ParamValidationError",
    "InvalidRegionError",
    "DefaultCredentialsError",
    "RefreshError",
    "ConfigParseError",
)


class StoreError(AppoccError):
    """A store does not answer, or refuses. It is no `DataError`: nothing is known about the file."""


class ObjectState(NamedTuple):
    """What a store says about an object.

    Attributes:
        url: its address.
        size: number of bytes; None if a web server does not say.
        is_folder: whether it is the common beginning of several names.
        mark: changes with the content: its tag, else its time; '' if unknown.
        mtime_ns: time of the last change, 0 if unknown.
    """

    url: str
    size: int | None
    is_folder: bool
    mark: str
    mtime_ns: int


def scheme_of(url: str) -> str:
    """Return the scheme of a URL.

    Raises:
        DataError: if it is none of `SCHEMES`.
    """
    scheme, separator, place = url.partition("://")
    if scheme not in _MODULES or not separator or not place:
        raise DataError(f"{url}: expected a URL such as s3://BUCKET/FOLDER")
    return scheme


def can_write(url: str) -> bool:
    """Return whether a store of this kind can be written and lists its names; web servers do neither."""
    return scheme_of(url) not in _WEB


def state_of_object(url: str) -> ObjectState | None:
    """Ask for an object; None if there is none.

    Raises:
        StoreError: if the store does not answer or refuses.
    """
    try:
        return _state(url, _try(url, "be read", lambda store, address: store.info(address)))
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
        rows = _try(url, "be listed", lambda store, address: store.ls(address, detail=True))
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
    found = _try(url, "be listed", lambda store, address: store.find(address))
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
        return bytes(_try(url, "be read", lambda store, address: store.cat_file(address)))
    try:
        data = _try(url, "be read", lambda store, address: store.cat_file(address, start=0, end=most_bytes + 1))
    except _EmptyObjectError:
        return b""
    if len(data) > most_bytes:
        raise DataError(f"{url}: expected at most {most_bytes} bytes, got more")
    return bytes(data)


def download(url: str, state: ObjectState, target: Path) -> None:
    """Copy an object to a local file.

    Raises:
        FileNotFoundError: if there is none.
        StoreError: if the store does not answer or refuses, or sends another number of bytes than it said.
        OSError: if the local file cannot be written.
    """

    def copy(store: Any, address: str) -> None:
        target.write_bytes(b"")  # so that an error of the local disk is one
        store.get_file(address, str(target))
        got = target.stat().st_size
        if state.size is not None and got != state.size:
            raise ConnectionError(f"expected {state.size} bytes, got {got}")

    _try(url, "be read", copy)


def upload(source: Path, url: str) -> None:
    """Copy a local file to an object, which is there as a whole or not at all.

    Raises:
        DataError: if its store is read-only.
        StoreError: if the store does not answer or refuses.
    """
    check_writable(url)
    try:
        _try(url, "be written", lambda store, address: store.put_file(str(source), address))
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
    store = _store("s3", os.getpid())
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
        _try(url, "be removed", lambda store, address: store.rm_file(address))
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


# Requests -----------------------------------------------------------------------------------------------------------


class _EmptyObjectError(Exception):
    """A part was asked for of an object without bytes."""


@lru_cache(maxsize=8)
def _store(scheme: str, process: int) -> Any:
    """Connection of a process to the stores of a scheme."""
    fsspec = import_extra("fsspec", "remote", f"{scheme}://")
    import_extra(_MODULES[scheme], "remote", f"{scheme}://")
    options: dict[str, Any] = {}
    if scheme == "s3":
        options["config_kwargs"] = {"retries": {"max_attempts": 0}, **_TIMEOUTS_S}
    if scheme == "gs":  # it would print errors that are reported here
        logging.getLogger("gcsfs").setLevel(logging.CRITICAL)
    if scheme in _WEB:
        aiohttp = import_extra("aiohttp", "remote", f"{scheme}://")
        limits = {"sock_connect": _TIMEOUTS_S["connect_timeout"], "sock_read": _TIMEOUTS_S["read_timeout"]}
        options |= {"encoded": True, "client_kwargs": {"timeout": aiohttp.ClientTimeout(total=None, **limits)}}
    store = fsspec.filesystem(scheme, skip_instance_cache=True, use_listings_cache=False, **options)
    if scheme == "s3":
        store.retries = 1  # attempts are counted here
    return store


def forget_stores() -> None:
    """Make new connections: the environment may have changed."""
    _store.cache_clear()


def _address(url: str) -> str:
    """Return a URL as it is sent: names in a web address are quoted."""
    scheme, _, rest = url.partition("://")
    host, slash, path = rest.partition("/")
    return f"{scheme}://{host}{slash}{quote(path)}" if scheme in _WEB else url


def _try(url: str, deed: str, request: Callable[[Any, str], T]) -> T:
    """Make a request, a few times if the store is overloaded or the connection is lost.

    Raises:
        FileNotFoundError: if there is no such object.
        StoreError: as the last attempt, or if a further one would be in vain.
        OSError: of the local disk.
    """
    scheme = scheme_of(url)
    waits = () if scheme in _OWN_ATTEMPTS else _WAITS_S
    for wait_s in (*waits, None):
        try:
            return request(_store(scheme, os.getpid()), _address(url))
        except (AppoccError, _EmptyObjectError):
            raise
        except Exception as error:
            status = next(_statuses(error), None)
            if status == 416:
                raise _EmptyObjectError from error
            if _is_missing(error, status):
                raise FileNotFoundError(url) from error
            if _is_of_the_disk(error):
                raise
            if wait_s is None or _is_final(error, status):
                attempts = _OWN_ATTEMPTS.get(scheme, len(waits) + 1)
                raise StoreError(f"{url}: cannot {deed} ({_reason(error, status, attempts)})") from error
        time.sleep(wait_s * random.uniform(0.5, 1.0))
    raise AssertionError("the last attempt returns or raises")


def _causes(error: BaseException) -> Iterator[BaseException]:
    """Yield an error and the errors that it was made of."""
    seen: BaseException | None = error
    while seen is not None:
        yield seen
        seen = seen.__cause__


def _statuses(error: BaseException) -> Iterator[int]:
    """Yield the HTTP status of an error of any of the clients, as a server has answered it."""
    for each in _causes(error):
        response = getattr(each, "response", None)
        named = response.get("ResponseMetadata", {}).get("HTTPStatusCode") if isinstance(response, dict) else None
        code = getattr(each, "code", None) if type(each).__name__ == "HttpError" else None  # gcsfs
        for value in (named, getattr(each, "status", None), code):
            if str(value).isdecimal():
                yield int(str(value))


def _is_missing(error: BaseException, status: int | None) -> bool:
    if _no_bucket(error):
        return False
    return status in _MISSING or (isinstance(error, FileNotFoundError) and error.__cause__ is None)


def _no_bucket(error: BaseException) -> bool:
    responses = (getattr(each, "response", None) for each in _causes(error))
    return any(each.get("Error", {}).get("Code") == "NoSuchBucket" for each in responses if isinstance(each, dict))


def _is_of_the_disk(error: BaseException) -> bool:
    """Whether the local file of a transfer is at fault: only the errors of the system name a file."""
    return isinstance(error, OSError) and error.filename is not None and not isinstance(error, FileNotFoundError)


def _is_final(error: BaseException, status: int | None) -> bool:
    if _no_bucket(error) or _is_denied(error, status):
        return True
    if status is not None:
        return 400 <= status < 500 and status not in (408, *_OVERLOADED)
    known = any(type(each).__name__ in _HOPELESS for each in _causes(error))
    return known or isinstance(error, ValueError | TypeError | ImportError)


def _is_denied(error: BaseException, status: int | None) -> bool:
    # gcsfs has no type of error for it
    return status in _DENIED or isinstance(error, PermissionError) or str(error).startswith("Forbidden")


def _reason(error: BaseException, status: int | None, attempts: int) -> str:
    if _no_bucket(error):
        return "no such bucket"
    if _is_denied(error, status):
        return "access denied: expected credentials with the right to it"
    repeated = "" if _is_final(error, status) else f", after {attempts} attempts"
    if status in _OVERLOADED:
        return f"the store is overloaded: {status}{repeated}"
    if type(error).__name__ == "ClientPayloadError":
        return f"the answer ends too early{repeated}"
    first = (str(error).strip() or type(error).__name__).splitlines()[0]
    # What follows a question mark in an address may be a signature.
    return re.sub(r"\?\S+", "", first) + repeated
