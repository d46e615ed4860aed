"""`appocc rig`: calibration of one's own cameras."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated

import typer

from cli.common import JsonOption, emit, local_out_path, local_path, progress, say

app = typer.Typer(name="rig", help="Calibrate your own cameras.", no_args_is_help=True)
# Reprojection errors in pixels with a warning; a good calibration is far below.
_BOARD_PX, _POINT_PX = 1.0, 5.0


@app.callback()
def rig() -> None:
    """Calibrate your own cameras."""


@app.command()
def fit(
    boards: Annotated[
        Path,
        typer.Argument(
            metavar="BOARDS", parser=local_path, help="Folder with a sub-folder of checkerboard pictures per camera."
        ),
    ],
    points: Annotated[
        Path,
        typer.Option(
            "--points", parser=local_path, help="CSV with camera, u, v, x, y[, z]: pixels of points in the ego frame."
        ),
    ],
    out: Annotated[Path, typer.Option("--out", parser=local_out_path, help="Rig file to write (.yaml).")],
    board: Annotated[str, typer.Option(metavar="CxR", help="Inner corners of the board, across and down.")] = "9x6",
    fisheye: Annotated[
        list[str] | None, typer.Option("--fisheye", help="Camera with a fisheye; can be repeated.")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Fit a rig: lenses to pictures of a checkerboard, poses to points on the ground that you measured.

    The names of the sub-folders are those of the cameras: CAM_FRONT, CAM_BACK_LEFT, ... or front, back_left, ...

    Example: appocc rig fit BOARDS --board 9x6 --points points.csv --out rig.yaml
    """
    from appocc.errors import DataError
    from appocc.own_cameras.rig_fit import board_pictures, fit_rig, write_rig

    corners = re.fullmatch(r"(\d{1,2})x(\d{1,2})", board)
    if corners is None or min(int(corners[1]), int(corners[2])) < 3:
        raise DataError(f"--board: expected inner corners across and down, such as 9x6, got '{board}'")
    pictures = board_pictures(boards)
    with progress("checkerboards", sum(len(paths) for paths in pictures.values())) as advance:
        size = int(corners[1]), int(corners[2])
        cameras = fit_rig(pictures, size, points, fisheye or (), advance)
    write_rig(out, cameras)
    if as_json:
        emit({"rig": str(out), "cameras": {name: camera.as_json() for name, camera in cameras.items()}})
    for name, camera in cameras.items():
        lens, pose = camera.intrinsics, camera.mounting
        say(
            f"{name}: board {lens.error_px:.2f} px in {lens.boards} of {lens.pictures} pictures, "
            f"points {pose.error_px:.2f} px (worst {pose.worst_px:.1f} px, line {pose.worst_line})"
        )
        if lens.error_px > _BOARD_PX or pose.error_px > _POINT_PX:
            say(f"{name}: a large error: is the board flat, and does --fisheye or a point's line fit?")
    say(f"{out}; look at it with: appocc check-rig IMAGES --rig {out} --out rig.png")
