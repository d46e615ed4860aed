"""Write a layout as SUMO's plain XML and convert it with netconvert."""

from __future__ import annotations

import tempfile
from pathlib import Path

from appocc.checks import FloatArray
from appocc.simulation.town_generation.layout import Layout, Street
from appocc.simulation.town_generation.tools import netconvert

PARKING_M = 2.3
# Short cycles keep queues short; turns are slow, so that vehicles do not swing round.
SIGNALS = ["--tls.cycle.time", "40", "--tls.yellow.time", "3"]
SHAPES = ["--junctions.corner-detail", "8", "--junctions.internal-link-detail", "12"]
TURNS = ["--junctions.limit-turn-speed", "2.2", "--junctions.limit-turn-speed.min-angle", "10"]


def write_network(layout: Layout, path: Path) -> None:
    """Convert a layout to a SUMO network (.net.xml).

    Raises:
        AppoccError: if SUMO is missing.
        DataError: if netconvert fails.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "town.nod.xml").write_text(_nodes(layout), encoding="utf-8")
        (folder / "town.edg.xml").write_text(_edges(layout), encoding="utf-8")
        plain = ["-n", str(folder / "town.nod.xml"), "-e", str(folder / "town.edg.xml"), "-o", str(path)]
        options = ["--no-turnarounds", "true", "--offset.disable-normalization", "true"]
        netconvert(path, [*plain, *options, *SIGNALS, *SHAPES, *TURNS])


def _nodes(layout: Layout) -> str:
    lines = [
        f'<node id="{c.name}" x="{c.xy_m[0]:.2f}" y="{c.xy_m[1]:.2f}" type="{c.kind}" radius="{c.radius_m}"/>'
        for c in layout.crossings
    ]
    return "<nodes>\n" + "\n".join(lines) + "\n</nodes>\n"


def _edges(layout: Layout) -> str:
    lines = []
    for street in layout.streets:
        line = street.line_m
        lines.append(_edge(street, street.name, (street.start, street.end), line, street.lanes[0]))
        if street.lanes[1]:
            lines.append(_edge(street, f"-{street.name}", (street.end, street.start), line[::-1], street.lanes[1]))
    return "<edges>\n" + "\n".join(lines) + "\n</edges>\n"


def _edge(street: Street, name: str, ends: tuple[str, str], line_m: FloatArray, driving: int) -> str:
    """Return one direction as XML; lane 0 is the rightmost, and one-way streets may have parking on the left, too."""
    back = name.startswith("-")
    one_way = street.lanes[1] == 0
    park = f'disallow="all" width="{PARKING_M}"'
    drive = f'disallow="pedestrian tram rail rail_urban ship" width="{street.lane_m}"'
    lanes = [park] if street.parking[1 if back else 0] else []
    lanes += [drive] * driving
    lanes += [park] if one_way and street.parking[1] else []
    shape = " ".join(f"{x:.2f},{y:.2f}" for x, y in line_m)
    spread = "center" if one_way else "right"
    inner = "".join(f'<lane index="{k}" {lane}/>' for k, lane in enumerate(lanes))
    return (
        f'<edge id="{name}" from="{ends[0]}" to="{ends[1]}" numLanes="{len(lanes)}" speed="{street.speed_mps}" '
        f'priority="{street.priority}" spreadType="{spread}" shape="{shape}">{inner}</edge>'
    )
