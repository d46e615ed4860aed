"""The reader of road networks."""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import pytest

from appocc.errors import DataError, NotFoundError
from appocc.simulation.network import RoadNetwork, read_network

_NET = """<?xml version="1.0" encoding="UTF-8"?>
<net version="1.20">
  <location netOffset="5.00,-2.00" convBoundary="0.00,0.00,100.00,20.00" origBoundary="0,0,1,1" projParameter="!"/>
  <edge id=":j_0" function="internal">
    <lane id=":j_0_0" index="0" speed="5" length="3" shape="50,1 53,1"/>
    <lane id=":j_0_1" index="1" disallow="all" speed="5" length="3" shape="50,3 53,3"/>
  </edge>
  <edge id="a" from="i" to="j" priority="3">
    <lane id="a_0" index="0" disallow="all" speed="8.3" length="50" width="2.30" shape="0,-1 50,-1"/>
    <lane id="a_1" index="1" disallow="pedestrian tram" speed="8.3" width="3.20" shape="0,2,7 25,2,7 50,2,7"/>
    <lane id="a_2" index="2" allow="bicycle" speed="8.3" length="50" shape="0,4 50,4"/>
  </edge>
  <edge id="-a" from="j" to="i" priority="3">
    <lane id="-a_0" index="0" allow="pedestrian" speed="1" length="50" shape="50,6 0,6"/>
    <lane id="-a_1" index="1" type="median" disallow="all" speed="1" length="50" shape="50,5 0,5"/>
    <lane id="-a_2" index="2" type="parking" disallow="all" speed="1" length="50" shape="50,5 0,5"/>
    <lane id="-a_3" index="3" allow="emergency" speed="1" length="50" shape="50,5 0,5"/>
  </edge>
  <edge id="b" from="j" to="k" priority="1">
    <lane id="b_0" index="0" speed="8.3" length="50" shape="53,1 100,1"/>
  </edge>
  <junction id="j" type="traffic_light" x="51" y="1" shape="50,0 53,0 53,4 50,4"/>
  <junction id=":j_9" type="internal" x="51" y="1"/>
  <connection from="a" to="b" fromLane="1" toLane="0" via=":j_0_0" tl="j" linkIndex="4" dir="s" state="o"/>
  <connection from=":j_0" to="b" fromLane="0" toLane="0" dir="s" state="M"/>
</net>
"""


@pytest.fixture
def network(tmp_path: Path) -> RoadNetwork:
    file = tmp_path / "tiny.net.xml"
    file.write_text(_NET, encoding="utf-8")
    return read_network(file)


def test_lane_kinds(network: RoadNetwork) -> None:
    kinds = {name: lane.kind for name, lane in network.lanes.items()}
    assert kinds == {
        "a_0": "parking",
        "a_1": "driving",
        "a_2": "cycling",
        "-a_0": "walking",
        "-a_1": "other",
        "-a_2": "parking",
        "-a_3": "other",
        "b_0": "driving",
        ":j_0_0": "driving",
        ":j_0_1": "other",
    }


def test_heights_are_ignored(network: RoadNetwork) -> None:
    lane = network.lane("a_1")
    np.testing.assert_array_equal(lane.centre_m, [[0, 2], [25, 2], [50, 2]])
    assert (lane.width_m, lane.speed_mps, lane.index, lane.edge) == (3.2, 8.3, 1, "a")
    assert not lane.centre_m.flags.writeable


def test_edges_know_the_other_direction(network: RoadNetwork) -> None:
    edges = {edge.name: edge for edge in network.edges}
    assert network.opposite(edges["a"]) is edges["-a"]
    assert network.opposite(edges["b"]) is None


def test_junctions_and_connections(network: RoadNetwork) -> None:
    (junction,) = network.junctions
    assert (junction.name, junction.kind, len(junction.outline_m)) == ("j", "traffic_light", 4)
    (way,) = network.connections
    assert (way.from_lane, way.to_lane, way.via, way.direction, way.signal, way.link) == (
        "a_1",
        "b_0",
        ":j_0_0",
        "s",
        "j",
        4,
    )
    np.testing.assert_array_equal(network.high_m, [100, 20])
    np.testing.assert_array_equal(network.offset_m, [5, -2])


def test_compressed_networks_are_read(tmp_path: Path, network: RoadNetwork) -> None:
    file = tmp_path / "tiny.net.xml.gz"
    file.write_bytes(gzip.compress(_NET.encode()))
    assert sorted(read_network(file).lanes) == sorted(network.lanes)


def test_an_unknown_lane_is_named(network: RoadNetwork) -> None:
    with pytest.raises(NotFoundError, match="no lane 'z_0'"):
        network.lane("z_0")


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "no SUMO network"),
        ("<routes/>", "expected the element 'net', got 'routes'"),
        ("<net/>", "it has no location"),
        (_NET[:700], "no SUMO network"),
        (_NET.replace("0,-1 50,-1", "0,-1 nan,-1"), "a_0"),
        (_NET.replace("0,-1 50,-1", "0,-1 oops,-1"), "oops"),
        (_NET.replace('priority="3"', 'priority="high"'), "high"),
        (_NET.replace("0.00,0.00,100.00,20.00", "0"), "convBoundary"),
    ],
)
def test_invalid_networks_give_one_line(tmp_path: Path, text: str, reason: str) -> None:
    file = tmp_path / "bad.net.xml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(DataError, match=reason) as caught:
        read_network(file)
    assert "\n" not in str(caught.value)
    assert "bad.net.xml" in str(caught.value)


def test_missing_and_damaged_files(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="cannot be read"):
        read_network(tmp_path / "none.net.xml")
    packed = gzip.compress(_NET.encode())
    for name, data in (("cut.net.xml.gz", packed[:100]), ("plain.net.xml.gz", _NET.encode())):
        (tmp_path / name).write_bytes(data)
        with pytest.raises(DataError, match=name):
            read_network(tmp_path / name)
