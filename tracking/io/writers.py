"""Writers of tracks: nuScenes tracking JSON, MOTChallenge text and CSV, each written atomically."""

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
from tracking.vehicle_classes import HEIGHT_M, class_from_size

# The category of instances of bird's-eye-view maps, whose class follows from the size.
_UNKNOWN_KIND = "vehicle"
_COLUMNS = (
    *("timestamp_us", "frame", "track_id", "class", "x_m", "y_m", "z_m", "yaw_rad", "length_m", "width_m"),
    *("vx_mps", "vy_mps", "r", "g", "b", "colour", "score", "seen", "heading_known"),
)


def assign_classes(tracks: Sequence[Sequence[Track]]) -> dict[int, str]:
    """Return the class of each track: its category, or the class by its median size if the category is "vehicle"."""
    sizes: dict[int, list[tuple[float, float]]] = {}
    kinds: dict[int, str] = {}
    for states in tracks:
        for track in states:
            sizes.setdefault(track.id, []).append((track.length_m, track.width_m))
            kinds[track.id] = track.kind
    return {
        name: class_from_size(*np.median(sizes[name], axis=0).tolist()) if kind == _UNKNOWN_KIND else kind
        for name, kind in kinds.items()
    }


def name_colours(rgb: FloatArray) -> list[str]:
    """Return names of sRGB colours (N, 3), 0..255, of vehicles; '' if unknown."""
    known = np.isfinite(rgb[:, 0])
    words = iter(words_of(rgb[known]))
    return [next(words) if each else "" for each in known]


def write_nuscenes(
    path: Path, sample_tokens: Sequence[str], tracks: Sequence[Sequence[Track]], modalities: Iterable[str]
) -> None:
    """Write nuScenes tracking results; every sample of the scene is present, including those without tracks.

    In addition to the keys of the benchmark, each entry has `rgb` (mean sRGB 0..255, null if unknown), `seen` (false
    if the position is predicted), `heading_known` and `velocity_known`. The translation is the centre of the box;
    unknown heights are those of the class.

    Args:
        path: file to write.
        sample_tokens: T sample tokens.
        tracks: T tuples of tracks.
        modalities: inputs of the detections: camera, lidar, radar, map or external.

    Raises:
        DataError: if the file cannot be written.
    """
    names = assign_classes(tracks)
    used = set(modalities)
    write_json(
        path,
        {
            "meta": {f"use_{name}": name in used for name in ("camera", "lidar", "radar", "map", "external")},
            "results": {
                token: [_entry(token, track, names[track.id]) for track in states]
                for token, states in zip(sample_tokens, tracks, strict=True)
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
        "velocity_known": track.velocity_known,
    }


def _rounded(values: FloatArray | list[float]) -> list[float]:
    """Round to millimetres."""
    return [round(float(value), 3) for value in values]


def write_mot(path: Path, tracks: Sequence[Sequence[Track]]) -> None:
    """Write MOTChallenge text, one line per track and frame: frame,id,left,top,width,height,conf,x,y,z.

    Frames are numbered from 1. Left, top, width and height are the axis-aligned rectangle around the footprint in
    world metres (left = minimum x, top = minimum y), so that evaluators by overlap work if the ground truth is
    written in the same way. conf is the track's score; x, y, z is the world point on the ground below its centre, in
    metres.

    Raises:
        DataError: if the file cannot be written.
    """
    lines = [_line(frame, track) for frame, states in enumerate(tracks, start=1) for track in states]
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
    """Write comma-separated values: a header, then a line for each track and frame.

    Frames are numbered from 1. Positions (on the ground below the centre), headings and velocities are in the world
    frame. vx and vy are empty if the velocity is unknown. r, g and b are sRGB 0..255 and colour is their name, all
    empty if unknown. seen is 0 if the position is predicted or interpolated, otherwise 1. heading_known is 0 if the
    yaw may be off by pi, otherwise 1.

    Args:
        path: file to write.
        times_us: T times.
        tracks: T sequences of tracks.

    Raises:
        ShapeError: if the numbers of times and frames differ.
        DataError: if the file cannot be written.
    """
    check_times("table of tracks", times_us, tracks)
    names = assign_classes(tracks)
    listed = [(frame, track) for frame, states in enumerate(tracks, start=1) for track in states]
    colours = name_colours(np.array([track.rgb for _, track in listed]).reshape(-1, 3))
    rows = [
        (int(times_us[frame - 1]), frame, track.id, names[track.id], *_cells(track, colour))
        for (frame, track), colour in zip(listed, colours, strict=True)
    ]
    write_table(path, _COLUMNS, rows)


def _cells(track: Track, colour: str) -> list[str]:
    """Return the columns from x_m on."""
    numbers = (*track.position_world_m, track.yaw_world_rad, track.length_m, track.width_m)
    velocity = [f"{value:.4f}" for value in track.velocity_world_mps] if track.velocity_known else [""] * 2
    rgb = [f"{value:.1f}" for value in track.rgb] if colour else [""] * 3
    flags = [str(int(track.seen)), str(int(track.heading_known))]
    return [*(f"{number:.4f}" for number in numbers), *velocity, *rgb, colour, f"{track.score:.4f}", *flags]


def write_table(path: Path, header: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """Write comma-separated values with Unix line ends.

    Raises:
        DataError: if the file cannot be written.
    """
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(header)
    table.writerows(rows)
    write_bytes(path, text.getvalue().encode())
