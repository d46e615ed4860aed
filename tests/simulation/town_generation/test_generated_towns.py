"""Towns generated with SUMO: from a seed, from CARLA's maps, and from invalid maps."""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import pytest

from appocc.errors import DataError
from appocc.simulation.network import RoadNetwork, read_network
from appocc.simulation.plan import TownPlan
from appocc.simulation.town_files import load_town
from appocc.simulation.town_generation.carriageway import draw_carriageway
from appocc.simulation.town_generation.layout import draw_layout
from appocc.simulation.town_generation.make import generate_town
from appocc.simulation.town_generation.opendrive import import_opendrive
from appocc.simulation.town_generation.streets import write_network
from appocc.simulation.town_generation.traffic import generate_traffic
from appocc.simulation.traffic import Light, TrafficLog

pytest.importorskip("libsumo")
pytest.importorskip("sumo")


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The network of a town of three by three blocks."""
    path = tmp_path_factory.mktemp("small") / "small.net.xml"
    write_network(draw_layout(5, lines=4), path)
    return path


@pytest.fixture(scope="module")
def network(small: Path) -> RoadNetwork:
    return read_network(small)


@pytest.fixture(scope="module")
def log(small: Path, network: RoadNetwork) -> TrafficLog:
    return generate_traffic(small, TownPlan("small", 5, "old", network), 8.0)


def test_a_generated_town_has_streets_to_drive_and_park_in(network: RoadNetwork) -> None:
    kinds = {lane.kind for edge in network.edges for lane in edge.lanes}
    assert kinds == {"driving", "parking"}
    widths = {lane.width_m for edge in network.edges for lane in edge.lanes if lane.kind == "parking"}
    assert widths == {2.3}
    assert network.junctions
    for way in network.connections:
        assert network.lane(way.from_lane).kind == network.lane(way.to_lane).kind == "driving"


def test_a_generated_town_has_traffic(network: RoadNetwork, log: TrafficLog) -> None:
    assert log.duration_s == pytest.approx(8.0)
    parked = (log.lights & int(Light.PARKED)).any(axis=0)
    people = np.array([actor.kind == "pedestrian" for actor in log.actors])
    assert np.count_nonzero(~parked & ~people) > 15
    assert np.count_nonzero(parked) > 20
    carriageway = draw_carriageway(network)
    places = log.xy_m[:, people].reshape(-1, 2).astype(np.float64)
    assert carriageway.distance_m(places).min() > 0.45
    assert carriageway.distance_m(places).max() < 2.6
    driving = log.xy_m[:, ~people & ~parked].reshape(-1, 2).astype(np.float64)
    assert np.mean(carriageway.distance_m(driving[np.isfinite(driving[:, 0])]) == 0) > 0.99
    assert len({actor.name for actor in log.actors}) == len(log.actors)


def test_the_same_plan_gives_the_same_traffic(small: Path, network: RoadNetwork, log: TrafficLog) -> None:
    again = generate_traffic(small, TownPlan("other", 5, "old", network), 8.0)
    assert again.actors == log.actors
    np.testing.assert_array_equal(again.xy_m, log.xy_m)
    np.testing.assert_array_equal(again.signals, log.signals)


def test_a_network_without_a_way_back_still_gives_a_town(tmp_path: Path) -> None:
    net = """<net version="1.20"><location netOffset="0,0" convBoundary="0,0,90,9" origBoundary="0,0,9,9"
    projParameter="!"/>
    <edge id="a" from="i" to="j" priority="3"><lane id="a_0" index="0" speed="8" length="90" shape="0,2 90,2"/></edge>
    <junction id="i" type="dead_end" x="0" y="2" incLanes="" intLanes="" shape="0,4 0,0"/>
    <junction id="j" type="dead_end" x="90" y="2" incLanes="a_0" intLanes="" shape="90,0 90,4"/></net>"""
    source = tmp_path / "lane.net.xml.gz"
    source.write_bytes(gzip.compress(net.encode()))
    assert generate_town(source, tmp_path / "out") == "lane"
    plan, log = load_town(tmp_path / "out", "lane")
    assert plan.name == "lane"
    assert all(
        actor.kind in ("car", "van", "truck", "bus", "motorcycle", "bicycle", "pedestrian") for actor in log.actors
    )


@pytest.mark.parametrize("text", ["", "hello", "<a/>", "<OpenDRIVE/>"])
def test_invalid_maps_give_one_line(tmp_path: Path, text: str) -> None:
    source = tmp_path / "bad.xodr"
    source.write_text(text, encoding="utf-8")
    with pytest.raises(DataError, match=r"bad\.xodr: no road network \(.+\)") as caught:
        generate_town(source, tmp_path / "out")
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "out").exists()


def test_missing_and_damaged_sources_give_one_line(tmp_path: Path) -> None:
    (tmp_path / "cut.net.xml.gz").write_bytes(gzip.compress(b"<net/>" * 99)[:20])
    (tmp_path / "plain.net.xml").write_bytes(b"<net/>")
    for name in ("none.xodr", "none.net.xml", "cut.net.xml.gz", "plain.net.xml"):
        with pytest.raises(DataError, match=name):
            generate_town(tmp_path / name, tmp_path / "out")


@pytest.mark.realdata
def test_carla_towns_keep_their_roadsides(data_root: Path, tmp_path: Path) -> None:
    for number in range(1, 8):
        path = tmp_path / f"{number}.net.xml"
        import_opendrive(data_root / "carla_towns" / "xodr" / f"Town0{number}.xodr", path)
        network = read_network(path)
        kinds = {lane.kind for edge in network.edges for lane in edge.lanes}
        assert {"driving", "shoulder"} <= kinds
        assert ("walking" in kinds) == (number != 6)
        assert ("parking" in kinds) == (number in (3, 5, 7))
        assert any(way.signal for way in network.connections)


@pytest.mark.realdata
def test_a_carla_town_is_generated(data_root: Path, tmp_path: Path) -> None:
    path = tmp_path / "Town02.net.xml"
    import_opendrive(data_root / "carla_towns" / "xodr" / "Town02.xodr", path)
    log = generate_traffic(path, TownPlan("Town02", 3, "old", read_network(path)), 5.0)
    kinds = {actor.kind for actor in log.actors}
    assert {"car", "pedestrian"} <= kinds
