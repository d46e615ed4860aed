"""`appocc record`: drives of a running simulator."""

from __future__ import annotations

from typing import Annotated

import typer

from cli.common import JsonOption, progress
from cli.convert.importing import OutArgument, report

app = typer.Typer(name="record", help="Record drives of a running simulator.")


@app.callback()
def _group() -> None:
    """Keep `carla` a subcommand."""


@app.command()
def carla(
    out: OutArgument,
    host: Annotated[str, typer.Option(help="Host of the CARLA server.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=1, max=65535, help="Port of the CARLA server.")] = 2000,
    town: Annotated[
        str | None, typer.Option(help="Map to load, such as Town05. Default: the one that is loaded.")
    ] = None,
    rig: Annotated[str, typer.Option(help="Name or YAML file of a camera rig of pinholes.")] = "paper",
    scenes: Annotated[int, typer.Option(min=1, max=9999, help="Number of drives.")] = 10,
    seconds: Annotated[float, typer.Option(min=0.1, max=600, help="Simulated time of each.")] = 20.0,
    hz: Annotated[float, typer.Option(min=0.1, max=20, help="Key frames per second.")] = 2.0,
    vehicles: Annotated[int, typer.Option(min=0, max=1000, help="Other vehicles.")] = 60,
    walkers: Annotated[int, typer.Option(min=0, max=1000, help="People.")] = 30,
    seed: Annotated[int, typer.Option(min=0, max=2**31 - 1, help="Random seed of places, vehicles and paints.")] = 0,
    as_json: JsonOption = False,
) -> None:
    """Record drives from a running CARLA server: cameras, LiDAR, boxes, paints, roads and exact maps.

    The server runs synchronously meanwhile, and is left as it was. The same command resumes.

    Example: appocc record carla OUT --town Town05 --scenes 20
    """
    from appocc.carla import DriveSettings, record_drives
    from appocc.rigs import read_source_rig

    settings = DriveSettings(scenes, max(1, round(seconds * hz)), hz, vehicles, walkers, seed)
    with progress("recording", scenes * settings.frames) as bar:
        summary = record_drives(out, host, port, town, read_source_rig(rig), settings, bar)
    report(summary, out, as_json)
