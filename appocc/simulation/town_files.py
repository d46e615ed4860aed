"""Town files: network, plan and recorded traffic of a town, small enough to ship with the package."""

from __future__ import annotations

import gzip
import re
from pathlib import Path
from typing import Any

import numpy as np

from appocc.checks import FloatArray
from appocc.errors import DataError
from appocc.files import read_json, write_bytes, write_json
from appocc.simulation.network import read_network
from appocc.simulation.plan import CarPark, TownPlan
from appocc.simulation.traffic import TrafficLog
from appocc.simulation.traffic_files import load_traffic, save_traffic

STYLES = ("old", "modern", "suburb", "industrial")


def save_town(folder: Path, plan: TownPlan, log: TrafficLog, network_xml: bytes) -> None:
    """Write `NAME.net.xml.gz`, `NAME.plan.json` and `NAME.traffic.npz`; the same town gives the same bytes.

    Args:
        folder: output folder.
        plan: the town; `network_xml` holds its network.
        log: its traffic.
        network_xml: text of SUMO's network; comments, which hold the time of creation, are removed.

    Raises:
        DataError: if a file cannot be written.
    """
    text = re.sub(rb"<!--.*?-->\s*", b"", network_xml, flags=re.DOTALL)
    write_bytes(folder / f"{plan.name}.net.xml.gz", gzip.compress(text, 9, mtime=0))
    save_traffic(folder / f"{plan.name}.traffic.npz", log)
    parks = [{"outline_m": _plain(park.outline_m), "bays": _plain(park.bays)} for park in plan.car_parks]
    write_json(folder / f"{plan.name}.plan.json", {"seed": plan.seed, "style": plan.style, "car_parks": parks}, None)


def load_town(folder: Path, name: str) -> tuple[TownPlan, TrafficLog]:
    """Read the files of `save_town`.

    Raises:
        DataError: if a file is missing, damaged, or not of a town.
    """
    file = folder / f"{name}.plan.json"
    value = read_json(file)
    try:
        parks = tuple(CarPark(_points(park["outline_m"], 2), _points(park["bays"], 3)) for park in value["car_parks"])
        seed, style = int(value["seed"]), value["style"]
        if style not in STYLES:
            raise ValueError(f"expected a style of {', '.join(STYLES)}, got '{style}'")
    except (KeyError, TypeError, ValueError) as error:
        raise DataError(f"{file}: no plan of a town ({type(error).__name__}: {error})") from error
    network = read_network(folder / f"{name}.net.xml.gz")
    return TownPlan(name, seed, str(style), network, parks), load_traffic(folder / f"{name}.traffic.npz")


def _plain(array: FloatArray) -> list[list[float]]:
    return [[round(float(v), 4) for v in row] for row in array]


def _points(value: Any, columns: int) -> FloatArray:
    points = np.array(value, dtype=np.float64).reshape(-1, columns)
    if not np.isfinite(points).all():
        raise ValueError("a coordinate is not finite")
    return points
