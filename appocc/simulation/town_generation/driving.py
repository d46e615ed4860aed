"""Run SUMO and record the front bumper of every vehicle ten times a second."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

import numpy as np

from appocc.checks import ByteArray, FloatArray
from appocc.errors import DataError
from appocc.simulation.network import RoadNetwork
from appocc.simulation.town_generation.bodies import BodyType
from appocc.simulation.town_generation.curve_speed import curve_speeds
from appocc.simulation.town_generation.tools import captured_errors, load_sumo

STEP_S = 0.1
_LOOK_STEPS = 2
_FILL_S = 60.0  # vehicles depart within this time


@dataclass(frozen=True)
class Driver:
    """A vehicle and the edges of its route."""

    name: str
    body: BodyType
    size_lwh_m: tuple[float, float, float]
    route: list[str]


@dataclass(frozen=True, eq=False)
class DriveRecord:
    """T steps of A driven vehicles.

    Attributes:
        front_m: (T, A, 2) middle of the front bumper; NaN while absent.
        yaw_rad: (T, A) heading from SUMO.
        lamps: (T, A) SUMO's signal bits: 1 right, 2 left indicator, 8 brake.
        links: names `light/link`.
        letters: (T, S) state of each link.
    """

    front_m: FloatArray
    yaw_rad: FloatArray
    lamps: ByteArray
    links: tuple[str, ...]
    letters: ByteArray


def simulate_driving(
    path: Path, network: RoadNetwork, drivers: list[Driver], times_s: tuple[float, float], seed: int
) -> DriveRecord:
    """Simulate the drivers, and record them after a warm-up.

    Args:
        path: network file of SUMO.
        network: its network.
        drivers: vehicles and routes.
        times_s: duration of the warm-up and of the recording.
        seed: random seed of SUMO.

    Raises:
        AppoccError: if SUMO is missing.
        DataError: if SUMO cannot run on this network.
    """
    sumo = load_sumo()
    if not drivers:  # SUMO can crash on networks that are mere fragments
        count = round(times_s[1] / STEP_S) + 1
        nowhere, dark = np.zeros((count, 0, 2)), np.zeros((count, 0), np.uint8)
        return DriveRecord(nowhere, nowhere[..., 0], dark, (), dark)
    with tempfile.TemporaryDirectory() as folder:
        routes = Path(folder) / "town.rou.xml"
        routes.write_text(_route_file(drivers), encoding="utf-8")
        options = ["--step-length", str(STEP_S), "--lateral-resolution", "0.8", "--seed", str(seed % 2**31)]
        # Vehicles that block a street for long are removed rather than teleported.
        options += ["--time-to-teleport", "40", "--time-to-teleport.remove", "true", "--ignore-route-errors", "true"]
        options += ["--no-step-log", "true", "--no-warnings", "true", "--collision.action", "none"]
        options += ["--collision.check-junctions", "false"]
        try:
            with captured_errors() as errors:
                sumo.start(["sumo", "-n", str(path), "-r", str(routes), *options])
            steps = (round(times_s[0] / STEP_S), round(times_s[1] / STEP_S) + 1)
            return _record(sumo, drivers, curve_speeds(network), steps)
        except (sumo.TraCIException, sumo.FatalTraCIError, RuntimeError) as error:
            reason = next(iter(errors), " ".join(str(error).split()))
            raise DataError(f"{path}: SUMO cannot run on it ({reason})") from error
        finally:
            sumo.close()


def _record(
    sumo: ModuleType, drivers: list[Driver], limits: dict[str, FloatArray], steps: tuple[int, int]
) -> DriveRecord:
    number = {driver.name: k for k, driver in enumerate(drivers)}
    most = {driver.name: driver.body.speed_mps for driver in drivers}
    front = np.full((steps[1], len(drivers), 2), np.nan)
    yaw = np.full((steps[1], len(drivers)), np.nan)
    lamps = np.zeros((steps[1], len(drivers)), np.uint8)
    lights = sumo.trafficlight
    names = sorted(lights.getIDList())
    links = tuple(f"{n}/{k}" for n in names for k in range(len(lights.getRedYellowGreenState(n))))
    letters = np.zeros((steps[1], len(links)), np.uint8)
    for step in range(sum(steps)):
        sumo.simulation.step()
        present = sumo.vehicle.getIDList()
        if step % _LOOK_STEPS == 0:
            _slow_down(sumo, present, most, limits)
        t = step - steps[0]
        if t < 0:
            continue
        for name in present:
            k = number[name]
            front[t, k] = sumo.vehicle.getPosition(name)
            yaw[t, k] = np.deg2rad(90.0 - sumo.vehicle.getAngle(name))
            lamps[t, k] = sumo.vehicle.getSignals(name) & 11
        states = "".join(lights.getRedYellowGreenState(n) for n in names)
        letters[t] = np.frombuffer(states.encode("ascii"), np.uint8)
    front[np.abs(front) > 1e6] = np.nan  # SUMO's value for unknown positions
    return DriveRecord(front, yaw, lamps, links, letters)


def _slow_down(
    sumo: ModuleType, present: tuple[str, ...], most: dict[str, float], limits: dict[str, FloatArray]
) -> None:
    """Limit the speed of each vehicle in a curve."""
    for name in present:
        lane = sumo.vehicle.getLaneID(name)
        speed = most[name]
        if lane in limits:
            share = sumo.vehicle.getLanePosition(name) / sumo.lane.getLength(lane)
            last = len(limits[lane]) - 1
            speed = min(speed, float(limits[lane][min(int(share * last + 1.0), last)]))
        if speed != sumo.vehicle.getMaxSpeed(name):
            sumo.vehicle.setMaxSpeed(name, speed)


def _route_file(drivers: list[Driver]) -> str:
    lines = []
    for k, driver in enumerate(drivers):
        length, width, height = driver.size_lwh_m
        two_wheels = driver.body.kind in ("motorcycle", "bicycle")
        side = "right" if driver.body.kind == "bicycle" else "center"
        lines.append(
            f'<vType id="t{k}" vClass="{driver.body.sumo}" length="{length}" width="{width}" height="{height}" '
            f'maxSpeed="{driver.body.speed_mps}" speedFactor="normc(0.92,0.08,0.75,1.1)" '
            f'minGap="{1.6 if two_wheels else 2.4}" '
            f'latAlignment="{side}" maxSpeedLat="0.9" lcMaxSpeedLatFactor="0.18" lcMaxSpeedLatStanding="0" '
            f'minGapLat="0.7" lcPushy="0" accel="{1.2 if side == "right" else 2.0}" decel="3.5" sigma="0.3" '
            'jmTimegapMinor="1.5" jmIgnoreKeepClearTime="-1"/>'
        )
    for k, driver in enumerate(drivers):
        lines.append(
            f'<vehicle id="{driver.name}" type="t{k}" depart="{_FILL_S * k / len(drivers):.1f}" departLane="best" '
            f'departPos="random_free" departSpeed="0"><route edges="{" ".join(driver.route)}"/></vehicle>'
        )
    return "<routes>\n" + "\n".join(lines) + "\n</routes>\n"
