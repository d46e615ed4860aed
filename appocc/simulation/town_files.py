"""Towns as files: the network, the plan and the recorded traffic of one town, small enough to be shipped."""

from __future__ import annotations

import gzip
import io
import json
import re
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from appocc.checks import FloatArray
from appocc.errors import AppoccError, DataError
from appocc.files import read_json, write_bytes, write_json, zip_arrays
from appocc.simulation.network import read_network
from appocc.simulation.plan import CarPark, TownPlan
from appocc.simulation.traffic import KINDS, Actor, TrafficLog

STYLES = ("old", "modern", "suburb", "industrial")
_PLACE_M, _TURN_RAD = 0.01, np.deg2rad(0.25)
_VERSION = 1


def network_file(folder: Path, name: str) -> Path:
    """Where a town's network lies."""
    return folder / f"{name}.net.xml.gz"


def save_town(folder: Path, plan: TownPlan, log: TrafficLog, network_xml: bytes) -> None:
    """Write `NAME.net.xml.gz`, `NAME.plan.json` and `NAME.traffic.npz`; the same town gives the same bytes.

    Args:
        folder: where to.
        plan: the town; its network is what `network_xml` holds.
        log: its traffic.
        network_xml: text of SUMO's network; comments, which hold the time of making, are left out.

    Raises:
        DataError: if a file cannot be written.
    """
    text = re.sub(rb"<!--.*?-->\s*", b"", network_xml, flags=re.DOTALL)
    write_bytes(network_file(folder, plan.name), gzip.compress(text, 9, mtime=0))
    write_bytes(folder / f"{plan.name}.traffic.npz", _packed(log))
    parks = [{"outline_m": _plain(p.outline_m), "bays": _plain(p.bays)} for p in plan.car_parks]
    write_json(folder / f"{plan.name}.plan.json", {"seed": plan.seed, "style": plan.style, "car_parks": parks}, None)


def load_town(folder: Path, name: str) -> tuple[TownPlan, TrafficLog]:
    """Read what `save_town` wrote.

    Raises:
        DataError: if a file is missing, damaged, or none of a town.
    """
    plan_file = folder / f"{name}.plan.json"
    value = read_json(plan_file)
    try:
        parks = tuple(CarPark(_points(p["outline_m"], 2), _points(p["bays"], 3)) for p in value["car_parks"])
        seed, style = int(value["seed"]), str(value["style"])
    except (KeyError, TypeError, ValueError) as error:
        raise DataError(f"{plan_file}: no plan of a town ({type(error).__name__}: {error})") from error
    if style not in STYLES:
        raise DataError(f"{plan_file}: expected a style of {', '.join(STYLES)}, got '{style}'")
    return TownPlan(name, seed, style, read_network(network_file(folder, name)), parks), load_traffic(
        folder / f"{name}.traffic.npz"
    )


def load_traffic(path: Path) -> TrafficLog:
    """Read recorded traffic.

    Raises:
        DataError: if the file is missing, damaged, or holds something else.
    """
    try:
        with path.open("rb") as handle, zip_arrays(handle) as archive:
            return _unpacked({name: archive[name] for name in archive.files})
    except OSError as error:
        raise DataError(f"{path}: cannot be read ({error.strerror or error})") from error
    except (AppoccError, ValueError, KeyError, TypeError, IndexError, EOFError, zipfile.BadZipFile) as error:
        raise DataError(f"{path}: no recorded traffic ({' '.join(str(error).split())})") from error
    except Exception as error:  # zlib, struct and numpy's header parser on damaged bytes
        raise DataError(f"{path}: damaged ({type(error).__name__})") from error


def _plain(array: FloatArray) -> list[list[float]]:
    return [[round(float(v), 4) for v in row] for row in array]


def _points(value: Any, columns: int) -> FloatArray:
    points = np.array(value, dtype=np.float64).reshape(-1, columns)
    if not np.isfinite(points).all():
        raise ValueError("a coordinate is not finite")
    return points


def _packed(log: TrafficLog) -> bytes:
    """Who stands is one row; who moves is coded by the second differences of its places while it is there."""
    there = np.isfinite(log.xy_m[..., 0])
    still = there.all(axis=0) & (np.ptp(np.nan_to_num(log.xy_m), axis=0).max(axis=-1, initial=0) < _PLACE_M / 2)
    still &= (log.lights == log.lights[:1]).all(axis=0)
    moving = np.flatnonzero(~still)
    turns = np.unwrap(np.nan_to_num(log.yaw_rad[:, moving].astype(np.float64)), axis=0)
    place = np.nan_to_num(log.xy_m[:, moving].astype(np.float64))
    track = np.round(np.concatenate([place / _PLACE_M, turns[..., None] / _TURN_RAD], axis=2)).astype(np.int32)
    present = there[:, moving]
    first = np.where(present.any(axis=0), present.argmax(axis=0), 0)
    last = len(present) - np.where(present.any(axis=0), present[::-1].argmax(axis=0), 0)
    if (present.sum(axis=0) != last - first).any():
        raise DataError("traffic: expected every actor to be there without a gap")
    runs = [track[a:b, k] for k, (a, b) in enumerate(zip(first, last, strict=True))]
    starts = np.stack([run[0] for run in runs]) if runs else np.zeros((0, 3), np.int32)
    speeds = np.stack([run[1] - run[0] if len(run) > 1 else run[0] * 0 for run in runs]) if runs else starts
    bends = np.concatenate([np.diff(run, 2, axis=0) for run in runs] or [np.zeros((0, 3), np.int32)])
    if np.abs(bends).max(initial=0) > np.iinfo(np.int16).max:
        raise DataError("traffic: an actor moves too fast to be coded")
    poses = np.concatenate([log.xy_m[0, still] / _PLACE_M, log.yaw_rad[0, still, None] / _TURN_RAD], axis=1)
    info = {
        "version": _VERSION,
        "step_s": log.step_s,
        "actors": [[a.name, a.kind, a.body, *a.size_lwh_m] for a in log.actors],
    }
    info["signal_links"] = list(log.signal_links)
    arrays = {
        "info": np.frombuffer(json.dumps(info).encode(), np.uint8),
        "steps": np.array([len(log.xy_m)], np.int32),
        "still": still,
        "still_poses": np.round(poses).astype(np.int32),
        "still_lights": log.lights[0, still],
        "span": np.stack([first, last], axis=1).astype(np.int32),
        "starts": starts.astype(np.int32),
        "speeds": speeds.astype(np.int32),
        "bends": _shuffled(bends.astype(np.int16)),
        "lights": _changes(log.lights[:, moving]),
        "signals": _changes(log.signals),
    }
    stream = io.BytesIO()
    np.savez_compressed(stream, **arrays)  # type: ignore[arg-type]
    return stream.getvalue()


def _shuffled(values: NDArray[np.int16]) -> NDArray[np.uint8]:
    """(3, 2, N): low bytes apart from high ones, which are nearly all alike, so that they pack well."""
    return np.ascontiguousarray(values.T.astype("<i2")).view(np.uint8).reshape(3, -1, 2).transpose(0, 2, 1).copy()


def _changes(values: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """(N, T) difference (modulo 256) from step to step, actor by actor."""
    return np.ascontiguousarray(np.diff(values, axis=0, prepend=np.uint8(0)).T)


def _unpacked(arrays: dict[str, NDArray[Any]]) -> TrafficLog:
    info = json.loads(arrays["info"].tobytes())
    if info["version"] != _VERSION:
        raise ValueError(f"expected version {_VERSION}, got {info['version']}")
    actors = tuple(_actor(row) for row in info["actors"])
    steps, still = int(arrays["steps"][0]), arrays["still"].astype(np.bool_)
    moving = np.flatnonzero(~still)
    track = np.full((steps, len(actors), 3), np.nan)
    track[:, still] = arrays["still_poses"]
    halves = arrays["bends"].reshape(3, 2, -1).transpose(0, 2, 1)
    bends = np.ascontiguousarray(halves).view("<i2")[..., 0].T.astype(np.int64)
    used = 0
    for column, (first, last), start, speed in zip(
        moving, arrays["span"].tolist(), arrays["starts"], arrays["speeds"], strict=True
    ):
        count = max(last - first - 2, 0)
        run = np.concatenate([start[None], speed[None], bends[used : used + count]])[: last - first]
        run[1:] = np.cumsum(run[1:], axis=0)
        track[first:last, column] = np.cumsum(run, axis=0)
        used += count
    lights = np.zeros((steps, len(actors)), np.uint8)
    lights[:, still] = arrays["still_lights"]
    lights[:, moving] = np.cumsum(arrays["lights"].T, axis=0, dtype=np.uint8)
    yaw = np.mod(track[..., 2] * _TURN_RAD + np.pi, 2 * np.pi) - np.pi
    xy = (track[..., :2] * _PLACE_M).astype(np.float32)
    signals = np.cumsum(arrays["signals"].T, axis=0, dtype=np.uint8)
    links = tuple(str(link) for link in info["signal_links"])
    return TrafficLog(float(info["step_s"]), actors, xy, yaw.astype(np.float32), lights, links, signals)


def _actor(row: list[Any]) -> Actor:
    name, kind, body, *size = row
    length, width, height = (float(v) for v in size)
    if kind not in KINDS or min(length, width, height) <= 0:
        raise ValueError(f"actor '{name}': expected a kind of {', '.join(KINDS)} and a size, got '{kind}', {size}")
    return Actor(str(name), str(kind), str(body), (length, width, height))
