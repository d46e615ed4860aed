"""Figures of maps: the camera images as one looks out, and below them the colours and the classes of the cells."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from appocc.bevmap import BEVMap
from appocc.checks import ByteArray, FloatArray
from appocc.ego_vehicle import EgoVehicle
from appocc.frame import Frame
from appocc.geometry import footprints
from appocc.visualization.cameras import camera_sheet
from appocc.visualization.canvas import PANEL_LEGEND, PANELS, WHITE, BEVCanvas, caption
from appocc.visualization.labels import LabelPlacer
from appocc.visualization.layout import side_by_side, stack_centred
from appocc.visualization.vehicle_marks import VehicleMarks

_CELL_PX, _GAP_PX, _MIN_WIDTH_PX, _AWAY_PX = 4, 8, 1200, 14


def prediction_figure(frame: Frame, bev: BEVMap, vehicles: VehicleMarks) -> ByteArray:
    """Return a figure (H, W, 3) RGB: the images of a frame, and below them the colours and the classes of its map."""
    return figure_below_cameras(
        frame, bev, [[map_panel(bev, what, vehicles, frame.rig.ego_vehicle) for what in PANELS]]
    )


def figure_below_cameras(frame: Frame, bev: BEVMap, rows: Sequence[Sequence[ByteArray]]) -> ByteArray:
    """Return a figure (H, W, 3): the images that a map was predicted from, and below them rows of panels."""
    below = [side_by_side(panels, _GAP_PX) for panels in rows]
    rig = frame.rig.select(bev.meta.get("cameras", frame.images))
    width_px = max(_MIN_WIDTH_PX, *(row.shape[1] for row in below))
    return stack_centred([camera_sheet(frame.images, rig, width_px), *below])


def map_panel(
    bev: BEVMap, what: str, vehicles: VehicleMarks, ego: EgoVehicle, title: str = "", cell_px: int = _CELL_PX
) -> ByteArray:
    """Draw one of `PANELS` of a map below a caption; vehicles are labelled with their distance along x, metres.

    On the colours, vehicles are filled with their paint. Labels do not cover each other: where there is no room, the
    farther vehicle has none.
    """
    canvas = BEVCanvas(bev.grid, cell_px)
    getattr(canvas, what)(bev)
    vehicles = vehicles.select(bev.grid.contains(bev.grid.cell_of(vehicles.centre_m))).near_first()
    corners_m = footprints(vehicles.centre_m, vehicles.yaw_rad, vehicles.length_width_m)
    for corners, known, rgb in zip(corners_m, vehicles.heading_known, vehicles.rgb, strict=True):
        if what == "appearance" and np.isfinite(rgb).all():
            canvas.polygon(corners, (int(rgb[0]), int(rgb[1]), int(rgb[2])))
        canvas.line(corners, WHITE, 1, closed=True)
        if known:
            canvas.line([corners[[0, 3]].mean(axis=0), corners.mean(axis=0)], WHITE, 1)
    canvas.ego(ego)
    _label(canvas, vehicles, corners_m)
    text = f"{title}{PANELS[what]}; {PANEL_LEGEND}"
    if what == "appearance":
        text += "; faint: unsure" if bev.thresholds is not None else ""
        text += "; numbers: metres ahead" if len(corners_m) else ""
    return np.vstack([caption(text, canvas.picture.shape[1]), canvas.picture])


def _label(canvas: BEVCanvas, vehicles: VehicleMarks, corners_m: FloatArray) -> None:
    """Write the distances of the vehicles beside their boxes (N, 4, 2), in their order."""
    pixels = canvas.pixel(corners_m).astype(np.float64)
    boxes = np.concatenate([pixels.min(axis=1), pixels.max(axis=1)], axis=1)  # N 4
    labels = LabelPlacer(canvas.picture, boxes)
    for x, y in vehicles.centre_m:
        column, row = (int(v) for v in canvas.pixel((x, y)))
        labels.put((column, row), f"{x:+.1f} m", WHITE, None, _AWAY_PX)
