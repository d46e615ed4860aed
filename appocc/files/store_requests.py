"""Requests to stores: connections, a bounded number of attempts, and errors in one line."""

from __future__ import annotations

import logging
import os
import random
import re
import time
from collections.abc import Callable, Iterator
from functools import lru_cache
from typing import Any, TypeVar
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


class EmptyObjectError(Exception):
    """A part was asked for of an object without bytes."""


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


def connection(scheme: str) -> Any:
    """Return the fsspec file system of this process for the stores of a scheme.

    Raises:
        AppoccError: if the extra is not installed.
    """
    return _store(scheme, os.getpid())


def forget_stores() -> None:
    """Make new connections: the environment may have changed."""
    _store.cache_clear()


def _address(url: str) -> str:
    """Return a URL as it is sent: names in a web address are quoted."""
    scheme, _, rest = url.partition("://")
    host, slash, path = rest.partition("/")
    return f"{scheme}://{host}{slash}{quote(path)}" if scheme in _WEB else url


def attempt(url: str, deed: str, request: Callable[[Any, str], T]) -> T:
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
            return request(connection(scheme), _address(url))
        except (AppoccError, EmptyObjectError):
            raise
        except Exception as error:
            status = next(_statuses(error), None)
            if status == 416:
                raise EmptyObjectError from error
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
