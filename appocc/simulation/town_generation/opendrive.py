"""Import road networks from OpenDRIVE maps, such as CARLA's towns."""

from __future__ import annotations

import tempfile
from pathlib import Path

from appocc.errors import DataError
from appocc.simulation.town_generation.streets import SHAPES, SIGNALS, TURNS
from appocc.simulation.town_generation.tools import netconvert

_RESOLUTION_M = "0.5"
# netconvert opens these lanes to cars by default; they are part of the roadside.
_CLOSED = ("parking", "shoulder", "sidewalk", "border", "median", "none", "restricted")


def import_opendrive(source: Path, path: Path) -> None:
    """Convert an OpenDRIVE map to a SUMO network (.net.xml); parking lanes, shoulders and pavements are kept.

    Raises:
        AppoccError: if SUMO is missing.
        DataError: if the file cannot be read or is not an OpenDRIVE map; the message holds netconvert's reason.
    """
    if not source.is_file():
        raise DataError(f"{source}: cannot be read (no such file)")
    with tempfile.TemporaryDirectory() as folder:
        types = Path(folder) / "types.typ.xml"
        closed = "".join(f'<type id="{name}" priority="1" speed="13.89" disallow="all"/>' for name in _CLOSED)
        types.write_text(f"<types>{closed}</types>", encoding="utf-8")
        lanes = ["--opendrive.import-all-lanes", "true", "--opendrive.curve-resolution", _RESOLUTION_M]
        options = ["--type-files", str(types), "--no-turnarounds.except-deadend", "true"]
        file = ["--opendrive-files", str(source), "-o", str(path)]
        # Early CARLA maps have no signals: large junctions get them.
        options += ["--tls.guess", "true", "--tls.guess.threshold", "40"]
        netconvert(source, [*file, *lanes, *options, *SIGNALS, *SHAPES, *TURNS])
