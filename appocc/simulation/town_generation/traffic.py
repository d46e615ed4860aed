"""Traffic of a town: moving vehicles, parked vehicles, pedestrians, traffic lights."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from appocc.checks import ByteArray, FloatArray, IntArray
from appocc.simulation.plan import TownPlan
from appocc.simulation.town_generation.bodies import draw_body, draw_size
from appocc.simulation.town_generation.carriageway import draw_carriageway
from appocc.simulation.town_generation.driving import STEP_S, Driver, DriveRecord, simulate_driving
from appocc.simulation.town_generation.motion import vehicle_motion
from appocc.simulation.town_generation.overlaps import without_overlaps
from appocc.simulation.town_generation.parked import draw_parked
from appocc.simulation.town_generation.routes import Routes
from appocc.simulation.town_generation.walking import draw_walkers
from appocc.simulation.traffic import Actor, Light, TrafficLog
from appocc.simulation.traffic_files import UNIT

Group = tuple[list[Actor], FloatArray, FloatArray, ByteArray]  # actors, places, headings, lights
_EVERY = 2  # every second step of SUMO: 5 Hz
_WARM_S, _LEAD_S = 110.0, 10.0
_VEHICLE_EVERY_M, _MOST_VEHICLES, _WALKERS = 58.0, 150, 70
_FASTEST_MEAN_MPS = 12.0
_SHORTEST_STEPS = 25  # shorter presences are dropped
_LETTERS = {ord("G"): ord("G"), ord("g"): ord("g"), ord("y"): ord("y"), ord("Y"): ord("y"), ord("u"): ord("y")}


def generate_traffic(path: Path, plan: TownPlan, length_s: float = 260.0) -> TrafficLog:
    """Generate the traffic of a town; the same plan always gives the same traffic.

    Args:
        path: network file of the plan.
        plan: the town.
        length_s: length of the recording.

    Raises:
        AppoccError: if SUMO is missing.
        DataError: if SUMO cannot run on the network.
    """
    rng = np.random.default_rng([plan.seed, 2])
    drivers = _drivers(plan, rng, _WARM_S + length_s)
    times_s = (_WARM_S - _LEAD_S, length_s + _LEAD_S)
    record = simulate_driving(path, plan.network, drivers, times_s, plan.seed)
    lead = round(_LEAD_S / STEP_S)
    lengths = np.array([driver.size_lwh_m[0] for driver in drivers])
    centre, yaw, part = vehicle_motion(record.front_m, record.yaw_rad, lengths)
    kept = slice(lead, None, _EVERY)
    vehicles = _split_presences(drivers, part[kept], (centre[kept], yaw[kept], _lights(record)[kept]))
    return _join(plan, rng, vehicles, record.links, _letters(record.letters[kept]))


def _drivers(plan: TownPlan, rng: np.random.Generator, length_s: float) -> list[Driver]:
    routes = Routes(plan.network)
    count = min(round(routes.total_m / _VEHICLE_EVERY_M), _MOST_VEHICLES)
    drivers = []
    for k in range(count):
        body = draw_body(rng, parked=False)
        route = routes.draw(rng, length_s * _FASTEST_MEAN_MPS, large=body.length_m[0] > 5.8)
        drivers.append(Driver(f"{body.kind}_{k}", body, draw_size(rng, body), route))
    return [driver for driver in drivers if driver.route]


def _lights(record: DriveRecord) -> ByteArray:
    """Return (T, A) `Light` bits; SUMO switches brake lamps off when a car has stopped."""
    brake, left, right = (record.lamps & bit > 0 for bit in (8, 2, 1))
    speed = np.hypot(*np.moveaxis(np.diff(record.front_m, axis=0, append=record.front_m[-1:]), -1, 0)) / STEP_S
    stands = speed < 0.2
    bits = (brake | stands) * int(Light.BRAKE) + left * int(Light.LEFT) + right * int(Light.RIGHT)
    return np.where(np.isfinite(record.yaw_rad), bits, 0).astype(np.uint8)


def _letters(letters: ByteArray) -> ByteArray:
    table = np.full(256, ord("r"), np.uint8)
    table[list(_LETTERS)] = list(_LETTERS.values())
    return np.asarray(table[letters])


def _split_presences(
    drivers: list[Driver], part: IntArray, driven: tuple[FloatArray, FloatArray, ByteArray]
) -> Group:
    """Create one actor for each uninterrupted presence of a vehicle."""
    actors, columns = [], []
    for k, driver in enumerate(drivers):
        for number in range(int(part[:, k].max(initial=-1)) + 1):
            there = part[:, k] == number
            if np.count_nonzero(there) >= _SHORTEST_STEPS:
                name = driver.name + (f"_{number}" if number else "")
                actors.append(Actor(name, driver.body.kind, driver.body.name, driver.size_lwh_m))
                columns.append((k, there))
    placed, turned, shown = (np.full((len(a), len(actors), *a.shape[2:]), a.dtype.type(0)) for a in driven)
    for column, (k, there) in enumerate(columns):
        placed[:, column] = np.where(there[:, None], driven[0][:, k], np.nan)
        turned[:, column] = np.where(there, driven[1][:, k], np.nan)
        shown[:, column] = np.where(there, driven[2][:, k], 0)
    return actors, placed, turned, shown


def _join(
    plan: TownPlan,
    rng: np.random.Generator,
    driving: Group,
    links: tuple[str, ...],
    letters: ByteArray,
) -> TrafficLog:
    """Join all actors in one log and remove overlapping ones."""
    steps = len(driving[1])
    step_s = STEP_S * _EVERY
    times_s = np.arange(steps, dtype=np.float64) * step_s
    people, walked, looked = draw_walkers(draw_carriageway(plan.network), _WALKERS, times_s, rng)
    parked = draw_parked(plan, rng)
    place = np.array([spot[1:] for spot in parked]).reshape(-1, 3)
    actors = [*driving[0], *(spot.actor for spot in parked), *people]
    xy = np.concatenate([driving[1], np.tile(place[:, :2], (steps, 1, 1)), walked], axis=1)
    yaw = np.concatenate([driving[2], np.tile(place[:, 2], (steps, 1)), looked], axis=1)
    lights = np.concatenate([driving[3], np.full((steps, len(parked)), int(Light.PARKED)), looked * 0], axis=1)
    # Rounded as in the file, so that actors kept apart here stay apart.
    xy, yaw = np.round(xy / UNIT[:2]) * UNIT[:2], np.round(yaw / UNIT[2]) * UNIT[2]
    stands = np.isin(np.arange(len(actors)), len(driving[0]) + np.arange(len(parked)))
    keep = without_overlaps(actors, xy, yaw, stands)
    return TrafficLog(
        step_s=step_s,
        actors=tuple(actor for actor, stays in zip(actors, keep, strict=True) if stays),
        xy_m=xy[:, keep].astype(np.float32),
        yaw_rad=(np.mod(yaw[:, keep] + np.pi, 2 * np.pi) - np.pi).astype(np.float32),
        lights=lights[:, keep].astype(np.uint8),
        signal_links=links,
        signals=letters,
    )
