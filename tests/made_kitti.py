"""A folder of KITTI sequences made by hand: a parked car ahead of a moving camera."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from appocc.checks import FloatArray

FOCAL_PX, CENTRE_PX = 700.0, (620.0, 180.0)
PROJECTION = np.array([[FOCAL_PX, 0, CENTRE_PX[0], 0], [0, FOCAL_PX, CENTRE_PX[1], 0], [0, 0, 1.0, 0]])
STEP_M, FIRST_M = 1.0, 20.0
# Height, width, length; the bottom centre in the first camera's frame; the turn about y; left, top, right, bottom.
SIZE, SIDE_M, DOWN_M, TURN = "1.5 1.8 4.2", 2.0, 1.6, -1.5
BOX_PX = "600 170 700 240"


def write(path: Path, rows: Iterable[str]) -> Path:
    """A file of rows."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("".join(f"{row}\n" for row in rows))
    return path


def detection(frame: int, kind: int = 2, score: float = 3.0, ahead_m: float | None = None) -> str:
    """The car as a detector's row, at its own or another depth."""
    z = FIRST_M - frame * STEP_M if ahead_m is None else ahead_m
    box, size = BOX_PX.replace(" ", ","), SIZE.replace(" ", ",")
    return f"{frame},{kind},{box},{score},{size},{SIDE_M},{DOWN_M},{z},{TURN},-1.6"


def label(
    frame: int, id_: int = 4, kind: str = "Car", state: str = "0 0", ahead_m: float | None = None, box: str = BOX_PX
) -> str:
    """The car, or another object in its place, as a row of labels; `state` is truncation and occlusion."""
    z = FIRST_M - frame * STEP_M if ahead_m is None else ahead_m
    return f"{frame} {id_} {kind} {state} -1.6 {box} {SIZE} {SIDE_M} {DOWN_M} {z} {TURN}"


def region(frame: int, box: str) -> str:
    """A region in which objects were not marked."""
    return f"{frame} -1 DontCare -1 -1 -10 {box} -1000 -1000 -1000 -10 -1 -1 -1"


def pose(frame: int) -> str:
    """The camera's pose."""
    return f"1 0 0 0 0 1 0 0 0 0 1 {frame * STEP_M}"


def made_kitti(root: Path, frames: int = 3, names: Iterable[str] = ("0001",), labels: bool = True) -> Path:
    """The folder; the car is number 4."""
    for name in names:
        write(root / "detection_made" / f"{name}.txt", map(detection, range(frames)))
        write(root / "calib" / f"{name}.txt", ["P0: 1 2", "P2: " + " ".join(map(str, PROJECTION.ravel()))])
        write(root / "pose" / f"{name}.txt", map(pose, range(frames)))
        if labels:
            write(root / "label" / f"{name}.txt", map(label, range(frames)))
    return root


def box_around(row: list[str]) -> FloatArray:
    """Left, top, right, bottom (4,) around the 3D box of a result's columns, by KITTI's definitions, unclipped."""
    height, width, length, x, y, z, turn = map(float, row[10:17])
    cos, sin = np.cos(turn), np.sin(turn)
    sides = [(along, up, across) for along in (-1, 1) for up in (0, 1) for across in (-1, 1)]
    corners = np.array(sides) * [length / 2, -height, width / 2]
    about_y = np.array([[cos, 0, sin], [0, 1, 0], [-sin, 0, cos]])
    placed = corners @ about_y.T + [x, y, z]
    pixels = placed[:, :2] / placed[:, 2:] * FOCAL_PX + CENTRE_PX
    return np.concatenate([pixels.min(axis=0), pixels.max(axis=0)])
