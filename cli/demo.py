"""`appocc demo`: the whole pipeline on a short simulated drive."""

from __future__ import annotations

import os
from pathlib import Path
from shlex import quote
from typing import Annotated

import typer

from cli.common import JsonOption, emit, local_out_path, progress, say


def demo(
    out: Annotated[
        Path,
        typer.Option(
            "--out", parser=local_out_path, help="New folder, or an earlier demo, whose files are replaced."
        ),
    ] = Path("appocc-demo"),
    as_json: JsonOption = False,
) -> None:
    """Run the whole pipeline on a short simulated drive: pictures, predicted maps, tracks, grounded commands.

    Example: appocc demo --out appocc-demo
    """
    # With many small matrix products, several threads are slower on a busy machine. Set before numpy is imported.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from appocc.demo.folder import demo_folder
    from cli.demo_pipeline import run_demo

    with demo_folder(out) as folder:
        outcome = run_demo(folder, out, progress)
    if as_json:
        emit({"folder": str(out), **outcome})
    say((out / "README.txt").read_text())
    say(f"Everything is described in {out / 'README.txt'}; start with {out / 'bev.png'}.")
    say(f"To look around in the browser: appocc serve {quote(str(out))}")
