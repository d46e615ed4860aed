"""Run the page's server on a socket that is bound before anything else is done."""

from __future__ import annotations

import ipaddress
import socket

import uvicorn
from starlette.types import ASGIApp

from appocc.errors import DataError
from cli.server.guard import LOOPBACK

_BACKLOG, _MOST_CONNECTIONS, _IDLE_S, _CLOSING_S = 128, 256, 15, 2


def is_loopback(host: str) -> bool:
    """Return whether a name or address is of this machine alone."""
    try:
        return host in LOOPBACK or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def bound_socket(host: str, port: int) -> socket.socket:
    """Return a listening socket; port 0 is any free one.

    Raises:
        DataError: if the port is in use, or this machine has no such address.
    """
    try:
        family, _, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
    except OSError as error:
        raise DataError(f"--host {host}: no such address ({error.strerror or error})") from error
    bound = socket.socket(family, socket.SOCK_STREAM)
    bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        bound.bind(address)
        bound.listen(_BACKLOG)
    except OSError as error:
        bound.close()
        raise DataError(
            f"{host}:{port}: expected a free port ({error.strerror}); choose another one with --port"
        ) from error
    return bound


def address_of(host: str, bound: socket.socket) -> str:
    """Return the address of the page for a browser on this machine or, with another host, for others."""
    name = f"[{host}]" if ":" in host else host
    return f"http://{name}:{bound.getsockname()[1]}/"


def build_server(app: ASGIApp) -> uvicorn.Server:
    """Return a server that drops idle connections and refuses more than a few hundred of them."""
    config = uvicorn.Config(
        app,
        log_level="error",
        access_log=False,
        server_header=False,
        ws="none",
        limit_concurrency=_MOST_CONNECTIONS,
        timeout_keep_alive=_IDLE_S,
        timeout_graceful_shutdown=_CLOSING_S,
    )
    return uvicorn.Server(config)
