"""Generate a town from a seed, an OpenDRIVE map or a SUMO network."""

from __future__ import annotations

import tempfile
import zlib
from pathlib import Path

import numpy as np

from appocc.errors import DataError
from appocc.files import unzipped
from appocc.simulation.network import RoadNetwork, read_network
from appocc.simulation.plan import TownPlan
from appocc.simulation.town_files import STYLES, save_town
from appocc.simulation.town_generation.car_parks import draw_car_parks
from appocc.simulation.town_generation.carriageway import draw_carriageway
from appocc.simulation.town_generation.layout import draw_layout
from appocc.simulation.town_generation.opendrive import import_opendrive
from appocc.simulation.town_generation.streets import write_network
from appocc.simulation.town_generation.traffic import generate_traffic

_LARGEST_M = 3000.0  # the ground is a raster of the whole town


def generate_town(source: Path | int, folder: Path, name: str = "", style: str = "") -> str:
    """Generate a town and its traffic, and write its three files.

    Args:
        source: an OpenDRIVE map (.xodr), a SUMO network (.net.xml, .net.xml.gz), or a seed.
        folder: output folder.
        name: name of the town; by default the file's stem, or `town_SEED`.
        style: see `TownPlan.style`; by default drawn by name.

    Returns:
        The town's name.

    Raises:
        AppoccError: if SUMO is missing.
        DataError: if the source cannot be read, is not a road network, or a file cannot be written.
    """
    name = name or (f"town_{source}" if isinstance(source, int) else source.name.split(".")[0])
    seed = source if isinstance(source, int) else zlib.crc32(name.encode())
    style = style or STYLES[zlib.crc32(name.encode()) % len(STYLES)]
    with tempfile.TemporaryDirectory() as scratch:
        file = Path(scratch) / f"{name}.net.xml"
        _network(source, file)
        try:
            network = read_network(file)
            _check(file, network)
            rng = np.random.default_rng([seed, 3])
            parks = draw_car_parks(network, draw_carriageway(network), rng) if isinstance(source, int) else ()
            plan = TownPlan(name, seed, style, network, parks)
            log = generate_traffic(file, plan)
        except DataError as error:
            # An error in the scratch file is an error in its source.
            raise DataError(str(error).replace(str(file), str(source))) from error
        save_town(folder, plan, log, file.read_bytes())
    return name


def _check(file: Path, network: RoadNetwork) -> None:
    """Refuse networks that SUMO or the scenery cannot handle."""
    size_m = float((network.high_m - network.low_m).max())
    if not size_m <= _LARGEST_M:
        raise DataError(f"{file}: expected a map of at most {_LARGEST_M:g} m across, got {size_m:g} m")
    for lane in (lane for edge in network.edges for lane in edge.lanes if lane.kind == "driving"):
        if len(lane.centre_m) < 2 or not (lane.width_m > 0 and lane.speed_mps > 0):
            got = f"{len(lane.centre_m)} points, width {lane.width_m:g} m, speed {lane.speed_mps:g} m/s"
            raise DataError(f"{file}: lane {lane.name}: expected two points, a width and a speed limit, got {got}")


def _network(source: Path | int, file: Path) -> None:
    if isinstance(source, int):
        write_network(draw_layout(source), file)
    elif source.suffix == ".xodr":
        import_opendrive(source, file)
    else:
        file.write_bytes(unzipped(source))
