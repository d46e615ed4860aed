"""`appocc serve`: a page in the browser for recordings, maps, tracks and spoken commands."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path
from typing import Annotated

import typer

from cli.common import Interrupted, in_path, say


def serve(
    roots: Annotated[
        list[Path],
        typer.Argument(
            metavar="ROOT...",
            parser=in_path,
            help="Datasets in the nuScenes schema, folders of them, or an empty folder for simulated drives.",
            show_default=False,
        ),
    ],
    port: Annotated[int, typer.Option("--port", min=0, max=65535, help="Port; 0: any free one.")] = 8040,
    host: Annotated[
        str,
        typer.Option(
            "--host", help="Address to listen on. Other than this machine alone, the page needs the printed token."
        ),
    ] = "127.0.0.1",
) -> None:
    """Open recordings in the browser: cameras, maps and tracks over time, and commands in a conversation.

    The page needs no network and reads nothing outside of the given folders. Ctrl-C ends it.

    Example: appocc serve appocc-demo
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    import secrets

    from cli.server.app import build_app
    from cli.server.library import Library
    from cli.server.running import address_of, bound_socket, build_server, is_loopback

    library = Library(roots)
    token = None if is_loopback(host) else secrets.token_urlsafe(24)
    with bound_socket(host, port) as bound:
        address = address_of(host, bound)
        app = build_app(library, token)
        count = len(library.recordings())
        say(f"{count} recording{'' if count == 1 else 's'}. Open {address}{f'?token={token}' if token else ''}")
        say("Ctrl-C ends it.")
        with suppress(Interrupted):  # the usual end; a callback of the event loop may swallow it
            build_server(app).run(sockets=[bound])
        say("closed")
