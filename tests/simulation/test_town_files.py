"""Town files, and the built-in towns."""

from __future__ import annotations

import gzip
import json
import subprocess
import sys
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from appocc.checks import BoolArray, FloatArray
from appocc.errors import DataError, NotFoundError
from appocc.simulation.builtin import TEST_TOWNS, TOWNS_FOLDER, TRAIN_TOWNS, load_builtin
from appocc.simulation.plan import TownPlan
from appocc.simulation.scenario import draw_scenario
from appocc.simulation.sources import TownSource
from appocc.simulation.town_files import STYLES, load_town, save_town
from appocc.simulation.town_generation.make import generate_town
from appocc.simulation.traffic import Light, TrafficLog

_ALL = (*TRAIN_TOWNS, *TEST_TOWNS)
_BLOCKED = """
import sys
sys.modules["sumo"] = sys.modules["libsumo"] = None
from appocc.simulation.builtin import load_builtin
from appocc.simulation.town_generation.make import generate_town
plan, log = load_builtin("aldermoor")
print(plan.name, len(log.actors) > 100)
from pathlib import Path
try:
    generate_town(1, Path("nowhere"))
except Exception as error:
    print(type(error).__name__, error)
"""


@cache
def _town(name: str) -> tuple[TownPlan, TrafficLog]:
    return load_builtin(name)


def _of_kind(log: TrafficLog, *kinds: str) -> BoolArray:
    """Return which actors of these kinds move."""
    parked = (log.lights & int(Light.PARKED)).any(axis=0)
    return np.array([actor.kind in kinds for actor in log.actors]) & ~parked


def _turned(yaw_rad: FloatArray) -> FloatArray:
    return np.asarray(np.mod(np.diff(yaw_rad, axis=0) + np.pi, 2 * np.pi) - np.pi)


def test_built_in_towns_need_no_sumo(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", _BLOCKED], capture_output=True, text=True, check=True, cwd=Path(__file__).parents[2]
    )
    first, second = done.stdout.splitlines()
    assert first == "aldermoor True"
    assert second.startswith("AppoccError")
    assert "pip install '.[sumo]'" in second


_EDGE = """<net version="1.20"><location netOffset="0,0" convBoundary="0,0,{size},9" origBoundary="0,0,9,9"
projParameter="!"/><edge id="a" from="i" to="j"><lane id="a_0" index="0" {lane}/></edge></net>"""


@pytest.mark.parametrize(
    ("size", "lane", "message"),
    [
        (90, 'speed="8" length="90" shape="0,2"', "expected two points.*got 1 points"),
        (90, 'speed="8" width="0" length="90" shape="0,2 90,2"', "width 0 m"),
        (90, 'speed="-3" length="90" shape="0,2 90,2"', "speed -3 m/s"),
        (90000, 'speed="8" length="90000" shape="0,2 90000,2"', "at most 3000 m across, got 90000 m"),
        (90, 'speed="8" length="90" shape="0,2 x,2"', "no SUMO network"),
    ],
)
def test_an_unsuitable_network_is_refused_by_its_own_name(tmp_path: Path, size: int, lane: str, message: str) -> None:
    source = tmp_path / "odd.net.xml"
    source.write_text(_EDGE.format(size=size, lane=lane))
    with pytest.raises(DataError, match=message) as caught:
        generate_town(source, tmp_path / "out")
    assert str(caught.value).startswith(f"{source}: ")
    assert not (tmp_path / "out").exists()


def test_a_fragment_of_a_network_gives_a_town_without_drivers(tmp_path: Path) -> None:
    pytest.importorskip("libsumo", reason="SUMO is not installed")
    source = tmp_path / "piece.net.xml"
    source.write_text(_EDGE.format(size=90, lane='speed="8" length="90" shape="0,2 90,2"'))
    generate_town(source, tmp_path / "out")
    _, log = load_town(tmp_path / "out", "piece")
    assert not _of_kind(log, "car", "van", "truck", "bus", "motorcycle", "bicycle").any()


def test_errors_of_sumo_are_reported(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("libsumo", reason="SUMO is not installed")
    whole = gzip.decompress((TOWNS_FOLDER / "aldermoor.net.xml.gz").read_bytes())
    source = tmp_path / "odd.net.xml"
    source.write_bytes(whole.replace(b'linkIndex="1"', b'linkIndex="9999"'))
    with pytest.raises(DataError, match=r"odd\.net\.xml: SUMO cannot run on it \(.*9999"):
        generate_town(source, tmp_path / "out")
    assert capfd.readouterr().err == ""


def test_a_town_is_prepared_once_its_last_file_exists(tmp_path: Path) -> None:
    source = TownSource("made", 3)
    (tmp_path / "made.traffic.npz").write_bytes(b"")  # killed between two files
    assert not source.is_prepared(tmp_path)
    (tmp_path / "made.plan.json").write_bytes(b"{}")
    assert source.is_prepared(tmp_path)
    assert TownSource("aldermoor").is_prepared(tmp_path)


@pytest.mark.parametrize(("seconds", "hz"), [(0.0, 1.0), (1.0, 2.0), (1.0, 7.3), (9.5, 2.0), (120.0, 2.0)])
def test_the_ego_is_stationary_in_a_fifth_of_its_frames_at_most(seconds: float, hz: float) -> None:
    for number in range(40):
        log = _town(_ALL[number % len(_ALL)])[1]
        scenario = draw_scenario(number, "town", log, seconds, ("clear",), seed=0, hz=hz)
        frames = [log.state_at(scenario.start_s + k / hz) for k in range(round(seconds * hz) + 1)]
        speeds = [np.hypot(*state.velocity_mps[state.index == scenario.ego][0]) for state in frames]
        assert np.mean(np.array(speeds) < 0.5) <= 0.2


def test_empty_traffic_has_no_scenario() -> None:
    nobody = np.zeros((9, 0), np.float32)
    log = TrafficLog(
        step_s=0.2,
        actors=(),
        xy_m=np.zeros((9, 0, 2), np.float32),
        yaw_rad=nobody,
        lights=nobody.astype(np.uint8),
        signal_links=(),
        signals=nobody.astype(np.uint8),
    )
    with pytest.raises(DataError, match="no vehicle drives"):
        draw_scenario(0, "town", log, 1.0, ("clear",), 0)


def test_an_unknown_town_gives_the_known_ones() -> None:
    with pytest.raises(NotFoundError, match=r"no built-in town 'paris'; there are aldermoor.*isenford"):
        load_builtin("paris")


def test_towns_differ_in_streets_and_look() -> None:
    plans = [_town(name)[0] for name in _ALL]
    assert len({plan.seed for plan in plans}) == len(_ALL) == 8
    assert {plan.style for plan in plans} == set(STYLES)
    assert len({len(plan.network.lanes) for plan in plans}) > 5
    assert sum(path.stat().st_size for path in TOWNS_FOLDER.iterdir()) < 4e6


@pytest.mark.parametrize("name", _ALL)
def test_vehicle_motion_is_plausible(name: str) -> None:
    _, log = _town(name)
    cars = _of_kind(log, "car", "van", "truck", "bus")
    assert np.count_nonzero(cars) > 50
    xy, yaw = log.xy_m[:, cars].astype(np.float64), log.yaw_rad[:, cars].astype(np.float64)
    length = np.array([actor.size_lwh_m[0] for actor in log.actors])[cars]
    turn = _turned(yaw)
    rate = np.rad2deg(np.abs(turn[np.isfinite(turn)])) / log.step_s
    assert np.percentile(rate, 99.9) < 60
    assert rate.max() < 90
    ahead = np.stack([np.cos(yaw), np.sin(yaw)], axis=-1)
    axle = np.diff(xy - ahead * 0.3 * length[:, None], axis=0) / log.step_s
    middle = yaw[:-1] + turn / 2
    slip = np.abs(axle[..., 1] * np.cos(middle) - axle[..., 0] * np.sin(middle))
    assert np.nanpercentile(slip, 99.9) < 0.5
    forward = (axle * np.stack([np.cos(middle), np.sin(middle)], axis=-1)).sum(axis=-1)
    assert np.nanmin(forward) > -0.5  # nobody reverses; in tight turns the rear swings back a little
    assert np.nanmax(forward) < 18
    speed = np.abs(forward[np.isfinite(forward)])
    assert 0.08 < np.mean(speed < 0.3) < 0.4


@pytest.mark.parametrize("name", _ALL)
def test_streets_are_busy_and_people_walk(name: str) -> None:
    plan, log = _town(name)
    vehicles = np.array([actor.kind != "pedestrian" for actor in log.actors])
    egos = _of_kind(log, "car", "van")
    near = []
    for time in range(0, len(log.xy_m), 100):
        gap = log.xy_m[time, egos][:, None] - log.xy_m[time, vehicles][None]
        near += list((np.hypot(gap[..., 0], gap[..., 1]) < 40).sum(axis=1) - 1)
    assert np.median(near) > 5
    people = _of_kind(log, "pedestrian")
    step = np.hypot(*np.moveaxis(np.diff(log.xy_m[:, people], axis=0), -1, 0)) / log.step_s
    assert 0.85 < np.median(step) < 1.75
    assert step.max() < 2.2
    assert {chr(letter) for letter in np.unique(log.signals)} <= set("ryGg")
    links = {f"{way.signal}/{way.link}" for way in plan.network.connections if way.signal}
    assert links
    assert links <= set(log.signal_links)


@pytest.mark.parametrize("name", _ALL)
def test_no_two_actors_overlap(name: str) -> None:
    _, log = _town(name)
    size = np.array([actor.size_lwh_m[:2] for actor in log.actors])
    moving = np.flatnonzero(~(log.lights & int(Light.PARKED)).any(axis=0))
    for time in range(0, len(log.xy_m), 60):
        place, yaw = log.xy_m[time].astype(np.float64), log.yaw_rad[time].astype(np.float64)
        axes = np.stack([np.stack([np.cos(yaw), np.sin(yaw)], -1), np.stack([-np.sin(yaw), np.cos(yaw)], -1)], 1)
        half = axes * size[:, :, None] / 2
        for a in moving:
            gap = place - place[a]
            close = np.flatnonzero(np.hypot(*gap.T) < np.hypot(*size[a]) / 2 + np.hypot(*size.T) / 2)
            for b in close[close != a]:
                both = np.concatenate([axes[a], axes[b]])
                room = [abs(gap[b] @ n) - np.abs(half[a] @ n).sum() - np.abs(half[b] @ n).sum() for n in both]
                # An overlap of 0.05 m2 at a corner may be 0.3 m deep.
                assert max(room) > -0.32, (log.actors[a].name, log.actors[b].name, time)


def test_parked_cars_are_in_parking_lanes_and_bays() -> None:
    for name in _ALL:
        plan, log = _town(name)
        lanes = [lane for edge in plan.network.edges for lane in edge.lanes if lane.kind == "parking"]
        spots = np.concatenate([*(lane.centre_m for lane in lanes), *(park.bays[:, :2] for park in plan.car_parks)])
        parked = (log.lights & int(Light.PARKED)).any(axis=0)
        gap = [np.hypot(*(spots - xy).T).min() for xy in log.xy_m[0, parked]]
        assert np.count_nonzero(parked) > 100
        assert max(gap) < 2.6  # centre lines have a point every few metres
        assert np.ptp(log.xy_m[:, parked], axis=0).max() == 0


def test_towns_are_saved_and_loaded(tmp_path: Path) -> None:
    plan, log = _town("aldermoor")
    for folder in ("a", "b"):
        save_town(tmp_path / folder, replace(plan, name="x"), log, b"<!-- now -->\n<net>\n</net>")
    for name in ("x.net.xml.gz", "x.plan.json", "x.traffic.npz"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()
    (tmp_path / "a" / "x.net.xml.gz").write_bytes((TOWNS_FOLDER / "aldermoor.net.xml.gz").read_bytes())
    again, traffic = load_town(tmp_path / "a", "x")
    assert (again.seed, again.style, again.name) == (plan.seed, plan.style, "x")
    assert len(again.car_parks) == len(plan.car_parks)
    for mine, theirs in zip(again.car_parks, plan.car_parks, strict=True):
        np.testing.assert_array_equal(mine.outline_m, theirs.outline_m)
        np.testing.assert_array_equal(mine.bays, theirs.bays)
    np.testing.assert_array_equal(traffic.xy_m, log.xy_m)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"style": "gothic"}, "expected a style of old"),
        ({"seed": "many"}, "ValueError"),
        ({"car_parks": [{"bays": []}]}, "outline_m"),
        ({"car_parks": [{"outline_m": [[1, 2], [3, None]], "bays": []}]}, "no plan of a town"),
        ({"car_parks": 7}, "no plan of a town"),
    ],
)
def test_invalid_plans_give_one_line(tmp_path: Path, change: dict[str, object], reason: str) -> None:
    file = tmp_path / "x.plan.json"
    file.write_text(json.dumps({"seed": 1, "style": "old", "car_parks": [], **change}), encoding="utf-8")
    with pytest.raises(DataError, match=reason) as caught:
        load_town(tmp_path, "x")
    assert "x.plan.json" in str(caught.value)
    assert "\n" not in str(caught.value)
