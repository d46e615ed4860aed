"""Record drives from a running CARLA server as one dataset; an interrupted run is resumed drive by drive."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path

from appocc.carla.drive import Drive, DriveSettings
from appocc.carla.roads import read_roads
from appocc.carla.server import connected
from appocc.errors import DataError
from appocc.importers import Summary, import_logs
from appocc.rigs import SourceRig

# Longer steps are inexact: CARLA's own physics takes at most ten of 0.01 s each in one.
_LONGEST_STEP_S = 0.05


def record_drives(
    out: Path,
    host: str,
    port: int,
    town: str | None,
    rig: SourceRig,
    settings: DriveSettings,
    advance: Callable[[int], None] = lambda count: None,
) -> Summary:
    """Record drives to a new dataset `out`; the same call resumes an interrupted one.

    Raises:
        AppoccError: if the package carla is not installed.
        DataError: if the server fails, the rig has other cameras than pinholes, or `out` cannot be written.
    """
    if not rig.is_pinhole:
        raise DataError("expected a rig of pinholes, as CARLA's cameras are, got other lenses")
    delta_s = 1 / settings.hz / math.ceil(1 / settings.hz / _LONGEST_STEP_S - 1e-9)
    with connected(host, port, town, delta_s) as server:
        roads = read_roads(server.world.get_map())
        drives = [Drive(server, roads, rig.rig, settings, number) for number in range(settings.scenes)]
        known = {"town": server.town, "rig": rig.as_json(), **asdict(settings)}
        return import_logs(drives, out, "carla", known, advance=advance)
