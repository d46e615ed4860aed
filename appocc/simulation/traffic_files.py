"""Compact files of recorded traffic: positions to the centimetre, headings to a quarter of a degree."""

from __future__ import annotations

import io
import json
import zipfile
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from appocc.checks import BoolArray, ByteArray, FloatArray, IntArray
from appocc.errors import AppoccError, DataError
from appocc.files import read_file, write_bytes, zip_arrays
from appocc.simulation.traffic import KINDS, Actor, TrafficLog

UNIT = np.array([0.01, 0.01, np.deg2rad(0.25)])  # quantization of x, y (metres) and headings (radians)
_VERSION = 1
Arrays = dict[str, NDArray[Any]]


def save_traffic(path: Path, log: TrafficLog) -> None:
    """Write recorded traffic; the same log gives the same bytes.

    Raises:
        DataError: if the file cannot be written, or an actor reappears or jumps.
    """
    info = {
        "version": _VERSION,
        "step_s": log.step_s,
        "steps": len(log.xy_m),
        "actors": [[a.name, a.kind, a.body, *a.size_lwh_m] for a in log.actors],
        "signal_links": list(log.signal_links),
    }
    track = np.concatenate([log.xy_m, log.yaw_rad[..., None]], axis=2).astype(np.float64)
    still = _stationary(track, log.lights)
    moving = np.flatnonzero(~still)
    arrays: Arrays = {
        "info": np.frombuffer(json.dumps(info).encode(), np.uint8),
        "still": still,
        "still_poses": np.round(track[0, still] / UNIT).astype(np.int32),
        "still_lights": log.lights[0, still],
        **_encode_tracks([track[:, k] for k in moving], [log.actors[k].name for k in moving]),
        "lights": _differences(log.lights[:, moving]),
        "signals": _differences(log.signals),
    }
    stream = io.BytesIO()
    np.savez_compressed(stream, **arrays)  # type: ignore[arg-type]
    write_bytes(path, stream.getvalue())


def load_traffic(path: Path) -> TrafficLog:
    """Read recorded traffic.

    Raises:
        DataError: if the file is missing, damaged, or not recorded traffic.
    """
    packed = read_file(path)
    try:
        with zip_arrays(packed) as archive:
            return _decode_log({name: archive[name] for name in archive.files})
    except (AppoccError, ValueError, KeyError, TypeError, IndexError, EOFError, zipfile.BadZipFile) as error:
        raise DataError(f"{path}: no recorded traffic, or damaged ({' '.join(str(error).split())})") from error
    except Exception as error:  # zlib, struct and numpy's header parser raise more for damaged bytes
        raise DataError(f"{path}: damaged ({type(error).__name__})") from error


def _stationary(track: FloatArray, lights: ByteArray) -> BoolArray:
    """Return which actors never change: one row is enough for them."""
    with np.errstate(invalid="ignore"):
        same = (np.abs(track - track[:1]) < UNIT / 2).all(axis=(0, 2))
    return np.asarray(same & (lights == lights[:1]).all(axis=0))


def _encode_tracks(tracks: list[FloatArray], names: list[str]) -> Arrays:
    """Encode tracks (T, 3) as first and last step, first pose and step, and the second differences of the poses."""
    spans, starts, speeds, bends = ([np.zeros((0, n), np.int32)] for n in (2, 3, 3, 3))
    for track, name in zip(tracks, names, strict=True):
        there = np.flatnonzero(np.isfinite(track[:, 0]))
        if len(there) < 2 or there[-1] - there[0] + 1 != len(there):
            raise DataError(f"traffic: expected {name} to be present for two steps or more, without a gap")
        run = track[there]
        run[:, 2] = np.unwrap(run[:, 2])
        cells = np.round(run / UNIT).astype(np.int32)
        spans.append(np.array([[there[0], there[-1] + 1]], np.int32))
        starts.append(cells[:1])
        speeds.append(cells[1:2] - cells[:1])
        bends.append(np.diff(cells, 2, axis=0))
        if np.abs(bends[-1]).max(initial=0) > np.iinfo(np.int16).max:
            raise DataError(f"traffic: {name} jumps too far to be coded")
    joined = (np.concatenate(parts) for parts in (spans, starts, speeds, bends))
    return dict(
        zip(
            ("spans", "starts", "speeds", "bends"),
            (*list(joined)[:3], _split_bytes(np.concatenate(bends))),
            strict=True,
        )
    )


def _split_bytes(values: NDArray[np.int32]) -> ByteArray:
    """Return (3, 2, N) bytes of (N, 3) int16 numbers: low bytes and high bytes apart, which compresses better."""
    pairs = np.ascontiguousarray(values.T.astype("<i2")).view(np.uint8).reshape(3, -1, 2)
    return np.ascontiguousarray(pairs.transpose(0, 2, 1))


def _differences(values: ByteArray) -> ByteArray:
    """Return (N, T) differences (modulo 256) from step to step of (T, N) bytes."""
    return np.ascontiguousarray(np.diff(values, axis=0, prepend=np.uint8(0)).T)


def _decode_log(arrays: Arrays) -> TrafficLog:
    info = json.loads(arrays["info"].tobytes())
    if info["version"] != _VERSION:
        raise ValueError(f"expected version {_VERSION}, got {info['version']}")
    actors = tuple(_actor(row) for row in info["actors"])
    still = np.asarray(arrays["still"], dtype=np.bool_)
    moving = np.flatnonzero(~still)
    track = np.full((int(info["steps"]), len(actors), 3), np.nan)
    lights = np.zeros(track.shape[:2], np.uint8)
    track[:, still], lights[:, still] = arrays["still_poses"], arrays["still_lights"]
    for k, first, run in zip(moving, arrays["spans"][:, 0], _decode_tracks(arrays), strict=True):
        track[first : first + len(run), k] = run
    track *= UNIT
    lights[:, moving] = np.cumsum(arrays["lights"].T, axis=0, dtype=np.uint8)
    yaw = np.mod(track[..., 2] + np.pi, 2 * np.pi) - np.pi
    return TrafficLog(
        step_s=float(info["step_s"]),
        actors=actors,
        xy_m=track[..., :2].astype(np.float32),
        yaw_rad=yaw.astype(np.float32),
        lights=lights,
        signal_links=tuple(str(link) for link in info["signal_links"]),
        signals=np.cumsum(arrays["signals"].T, axis=0, dtype=np.uint8),
    )


def _decode_tracks(arrays: Arrays) -> list[IntArray]:
    """Decode the tracks of `_encode_tracks`, in units: one (N, 3) for each moving actor."""
    bends = np.ascontiguousarray(arrays["bends"].transpose(0, 2, 1)).view("<i2")[..., 0].T.astype(np.int64)
    lengths = np.diff(arrays["spans"], axis=1)[:, 0] - 2
    ends = np.concatenate([[0], np.cumsum(lengths)])
    if (lengths < 0).any() or ends[-1] != len(bends):
        raise ValueError("its tracks do not fit together")
    found = []
    for (low, high), start, speed in zip(pairwise(ends), arrays["starts"], arrays["speeds"], strict=True):
        steps = np.cumsum(np.concatenate([speed[None], bends[low:high]]), axis=0)
        found.append(np.cumsum(np.concatenate([start[None], steps]), axis=0))
    return found


def _actor(row: list[Any]) -> Actor:
    name, kind, body, *size = row
    length, width, height = (float(v) for v in size)
    if kind not in KINDS or not min(length, width, height) > 0:
        raise ValueError(f"actor '{name}': expected a kind of {', '.join(KINDS)} and a size, got '{kind}' and {size}")
    return Actor(str(name), str(kind), str(body), (length, width, height))
