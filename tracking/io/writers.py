"""Tracks on disk: nuScenes tracking JSON, MOTChallenge text and tables (CSV), each written whole or not at all."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from appocc.checks import FloatArray
from appocc.colours import names as words_of
from appocc.files import write_bytes, write_json
from appocc.geometry import quaternion_from_yaw
from tracking.tracks import Track, check_times

# A bird's-eye view knows only "vehicle": the class follows from the size, and the height, unseen from above, from it.
HEIGHT_M = {"motorcycle": 1.5, "car": 1.6, "truck": 2.8, "bus": 3.2}
_UNKNOWN_KIND = "vehicle"
_COLUMNS = (
    *("timestamp_us", "frame", "track_id", "class", "x_m", "y_m", "z_m", "yaw_rad", "length_m", "width_m"),
    *("vx_mps", "vy_mps", "r", "g", "b", "colour", "score", "seen"),
)


def class_of(length_m: float, width_m: float) -> str:
    """The nuScenes tracking class of a vehicle of a size: bus from 9.5 m, truck from 6.2 m, motorcycle if tiny."""
    if length_m >= 9.5:
        return "bus"
    if length_m >= 6.2:
        return "truck"
    return "motorcycle" if length_m < 2.8 and width_m < 1.2 else "car"


def class_names(tracks: Sequence[Sequence[Track]]) -> dict[int, str]:
    """The class of each track, one for its whole life: its kind if that is more than "vehicle", or by median size."""
    sizes: dict[int, list[tuple[float, float]]] = {}
    kinds: dict[int, str] = {}
    for moment in tracks:
        for track in moment:
            sizes.setdefault(track.id, []).append((track.length_m, track.width_m))
            kinds[track.id] = track.kind
    return {
        name: class_of(*np.median(sizes[name], axis=0).tolist()) if kind == _UNKNOWN_KIND else kind
        for name, kind in kinds.items()
    }


def colour_names(rgb: FloatArray) -> list[str]:
    """Words for the sRGB colours (N, 3), 0..255, of vehicles; '' where one is not known."""
    known = np.isfinite(rgb[:, 0])
    words = iter(words_of(rgb[known]))
    return [next(words) if each else "" for each in known]


def write_nuscenes(
    path: Path, sample_tokens: Sequence[str], tracks: Sequence[Sequence[Track]], modalities: Iterable[str]
) -> None:
    """Write nuScenes tracking results; every sample of the scene is present, also those without tracks.

    Beside the keys of the benchmark each entry has `rgb` (mean sRGB 0..255, null if unknown), `seen` (false where the
    place is predicted) and `heading_known`. The translation is the box's centre, half its height (or a usual one)
    above ground.

    Args:
        path: file to write.
        sample_tokens: T samples.
        tracks: T tuples of tracks.
        modalities: those of camera, lidar, radar, map and external that the maps were made from.

    Raises:
        DataError: if the file cannot be written.
    """
    names = class_names(tracks)
    used = set(modalities)
    write_json(
        path,
        {
            "meta": {f"use_{name}": name in used for name in ("camera", "lidar", "radar", "map", "external")},
            "results": {
                token: [_entry(token, track, names[track.id]) for track in moment]
                for token, moment in zip(sample_tokens, tracks, strict=True)
            },
        },
    )


def _entry(sample_token: str, track: Track, name: str) -> dict[str, Any]:
    height = track.height_m if np.isfinite(track.height_m) else HEIGHT_M.get(name, HEIGHT_M["car"])
    return {
        "sample_token": sample_token,
        "translation": _rounded(track.position_world_m + np.array([0.0, 0.0, height / 2])),
        "size": _rounded([track.width_m, track.length_m, height]),
        "rotation": quaternion_from_yaw(track.yaw_world_rad).round(6).tolist(),
        "velocity": _rounded(track.velocity_world_mps),
        "tracking_id": str(track.id),
        "tracking_name": name,
        "tracking_score": round(track.score, 4),
        "rgb": np.round(track.rgb, 1).tolist() if np.isfinite(track.rgb).all() else None,
        "seen": track.seen,
        "heading_known": track.heading_known,
    }


def _rounded(values: FloatArray | list[float]) -> list[float]:
    """Millimetres are enough."""
    return [round(float(value), 3) for value in values]


def write_mot(path: Path, tracks: Sequence[Sequence[Track]]) -> None:
    """Write MOTChallenge text, one line a track and moment: frame,id,left,top,width,height,conf,x,y,z.

    frame counts key frames from 1; left, top, width, height are the upright rectangle around the footprint in world
    metres (left = least x, top = least y), so that scorers by overlap work where truth is written alike; conf is
    the track's score; x, y, z the world point on the ground below its centre, in metres.

    Raises:
        DataError: if the file cannot be written.
    """
    lines = [_line(frame, track) for frame, moment in enumerate(tracks, start=1) for track in moment]
    write_bytes(path, "".join(lines).encode())


def _line(frame: int, track: Track) -> str:
    cos, sin = abs(np.cos(track.yaw_world_rad)), abs(np.sin(track.yaw_world_rad))
    width = track.length_m * cos + track.width_m * sin
    height = track.length_m * sin + track.width_m * cos
    x, y, z = track.position_world_m
    numbers = (x - width / 2, y - height / 2, width, height, track.score, x, y, z)
    return ",".join([str(frame), str(track.id), *(f"{number:.3f}" for number in numbers)]) + "\n"


# Tables -----------------------------------------------------------------------------------------------------------


def write_csv(path: Path, times_us: Sequence[int], tracks: Sequence[Sequence[Track]]) -> None:
    """Write comma-separated values: a header, then a line for each track and moment.

    Frames count from 1; places (on the ground below the centre), headings and velocities are in the world frame; r, g
    and b are sRGB 0..255 and colour is a word for them, all empty if unknown; seen is 1, or 0 where the place is
    predicted or filled in.

    Args:
        path: file to write.
        times_us: T times.
        tracks: T sequences of tracks.

    Raises:
        ShapeError: if there are not as many times as moments.
        DataError: if the file cannot be written.
    """
    check_times("table of tracks", times_us, tracks)
    names = class_names(tracks)
    told = [(frame, track) for frame, moment in enumerate(tracks, start=1) for track in moment]
    colours = colour_names(np.array([track.rgb for _, track in told]).reshape(-1, 3))
    rows = [
        (int(times_us[frame - 1]), frame, track.id, names[track.id], *_cells(track, colour))
        for (frame, track), colour in zip(told, colours, strict=True)
    ]
    write_table(path, _COLUMNS, rows)


def _cells(track: Track, colour: str) -> list[str]:
    """The columns from x_m on."""
    numbers = (*track.position_world_m, track.yaw_world_rad, track.length_m, track.width_m, *track.velocity_world_mps)
    rgb = [f"{value:.1f}" for value in track.rgb] if colour else [""] * 3
    return [*(f"{number:.4f}" for number in numbers), *rgb, colour, f"{track.score:.4f}", str(int(track.seen))]


def write_table(path: Path, header: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """Write comma-separated values, lines ended as on Unix.

    Raises:
        DataError: if the file cannot be written.
    """
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(header)
    table.writerows(rows)
    write_bytes(path, text.getvalue().encode())
