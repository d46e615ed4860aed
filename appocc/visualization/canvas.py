"""Drawing of maps and boxes; the only module that rotates the grid so that forward is up and left is left."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from appocc.bevmap import LANE, ROAD, VEHICLE, BEVMap
from appocc.camera import Camera
from appocc.checks import BoolArray, ByteArray, FloatArray
from appocc.ego_vehicle import EgoVehicle
from appocc.geometry import apply, inverse
from appocc.grid import BEVGrid

Colour = tuple[int, int, int]
WHITE, BLACK, GREEN, YELLOW, RED = (255, 255, 255), (0, 0, 0), (60, 200, 90), (255, 220, 60), (235, 70, 60)
# Unknown cells are hatched, because plain dark cells look like street: colours of background and lines, and period.
UNKNOWN_COLOUR, HATCH_COLOUR = (58, 62, 72), (92, 98, 112)
_HATCH_PX, _HATCH_LINE_PX = 12, 2
UNKNOWN_LEGEND = "hatched: unknown"
# What a panel shows of a map, and its caption; the last line is for all panels.
PANELS = {
    "appearance": "colour from above, ahead is up",
    "occupancy": "road grey, line markings yellow, vehicles blue, else black",
}
PANEL_LEGEND = f"{UNKNOWN_LEGEND}; green: our own car"
_CAPTION_PX, _CAPTION_SCALE = 26, 0.5
# Background of predicted colours, which are the fainter the less sure the network is that the cell is of any class.
_NOTHING_COLOUR = (38, 41, 48)
_EMPTY = 20
CLASS_COLOURS = {ROAD: (112, 112, 118), LANE: (245, 205, 70), VEHICLE: (70, 130, 240)}


def to_image_axes(cells: NDArray[np.uint8]) -> ByteArray:
    """Rotate a grid array (X, Y, ...) to image axes (rows, columns, ...): forward is up, left is left."""
    return np.ascontiguousarray(cells[::-1, ::-1])


def hatch_pattern(rows: int, columns: int) -> ByteArray:
    """Return a (rows, columns, 3) hatched image, the pattern of unknown cells."""
    line = np.add.outer(np.arange(rows), np.arange(columns)) % _HATCH_PX < _HATCH_LINE_PX
    return np.where(line[..., None], HATCH_COLOUR, UNKNOWN_COLOUR).astype(np.uint8)


def shown_appearance(bev: BEVMap) -> ByteArray:
    """Return the colours (X, Y, 3) of a map as they are drawn.

    Networks learn the colours of road, vehicles and lanes only. The opacity of a predicted cell is the square of its
    largest class probability: half as probable is four times as faint.
    """
    colours = np.moveaxis(bev.appearance, 0, -1)
    if bev.thresholds is None:
        return colours
    opacity = bev.occupancy.max(axis=0)[..., None] ** 2
    return np.asarray(opacity * colours + (1 - opacity) * np.array(_NOTHING_COLOUR), np.uint8)


def class_colours(bev: BEVMap) -> ByteArray:
    """Return a colour (X, Y, 3) for the class of each cell: vehicle over lane over road, others nearly black."""
    colours = np.full((*bev.grid.shape, 3), _EMPTY, np.uint8)
    for layer in (ROAD, LANE, VEHICLE):
        colours[bev.on[layer]] = CLASS_COLOURS[layer]
    return colours


class BEVCanvas:
    """Canvas for a grid with `scale` pixels per cell; coordinates are metres in the ego frame."""

    def __init__(self, grid: BEVGrid, scale: int = 4) -> None:
        """Create a canvas of unknown cells, hatched."""
        self.grid = grid
        self.scale = scale
        x, y = grid.shape
        self.picture: ByteArray = hatch_pattern(x * scale, y * scale)

    def pixel(self, xy_m: ArrayLike) -> NDArray[np.int32]:
        """Return the pixels (..., 2), (column, row), of points (..., 2) in the ego frame."""
        xy = np.asarray(xy_m, dtype=np.float64)
        column = (self.grid.y_max_m - xy[..., 1]) / self.grid.cell_m * self.scale
        row = (self.grid.x_max_m - xy[..., 0]) / self.grid.cell_m * self.scale
        return np.stack([np.floor(column), np.floor(row)], axis=-1).astype(np.int32)

    def cells(self, rgb: ByteArray, where: BoolArray | None = None) -> None:
        """Fill all cells or those of a mask (X, Y) with colours (X, Y, 3)."""
        picture = self._enlarged(to_image_axes(rgb))
        if where is None:
            self.picture[:] = picture
        else:
            mask = self._enlarged(to_image_axes(where.astype(np.uint8))) > 0
            self.picture[mask] = picture[mask]

    def _enlarged(self, picture: ByteArray) -> ByteArray:
        return picture.repeat(self.scale, axis=0).repeat(self.scale, axis=1)

    def appearance(self, bev: BEVMap) -> None:
        """Draw the appearance of a map, see `shown_appearance`; unknown cells stay hatched."""
        self.cells(shown_appearance(bev), bev.appearance_valid)

    def occupancy(self, bev: BEVMap) -> None:
        """Draw road, lane and vehicle cells in fixed colours, known empty cells in black."""
        self.cells(class_colours(bev), bev.occupancy_valid[ROAD] | bev.on.any(axis=0))

    def line(self, xy_m: ArrayLike, colour: Colour, width: int = 1, closed: bool = False) -> None:
        """Draw a polyline through points (N, 2) in the ego frame."""
        points = [self.pixel(xy_m).reshape(-1, 1, 2)]
        cv2.polylines(self.picture, points, closed, colour, width, cv2.LINE_AA)

    def polygon(self, xy_m: ArrayLike, colour: Colour) -> None:
        """Fill a polygon with corners (N, 2) in the ego frame."""
        cv2.fillPoly(self.picture, [self.pixel(xy_m).reshape(-1, 1, 2)], colour, cv2.LINE_AA)

    def dot(self, xy_m: ArrayLike, colour: Colour, radius: int = 3) -> None:
        """Draw a filled dot at a point (2,) in the ego frame."""
        column, row = (int(v) for v in self.pixel(xy_m))
        cv2.circle(self.picture, (column, row), radius, colour, -1, cv2.LINE_AA)

    def ego(self, vehicle: EgoVehicle) -> None:
        """Draw the footprint of the ego vehicle with its front marked."""
        left, rear = vehicle.width_m / 2, -vehicle.rear_overhang_m
        front = vehicle.length_m - vehicle.rear_overhang_m
        self.line([[front, left], [rear, left], [rear, -left], [front, -left]], GREEN, 2, closed=True)
        self.line([[front - 1.0, left], [front, 0.0], [front - 1.0, -left]], GREEN, 2)

    def label(self, xy_m: ArrayLike, text: str, colour: Colour = WHITE) -> None:
        """Write a short text centred at a point (2,) in the ego frame, shifted into the image."""
        column, row = (int(v) for v in self.pixel(xy_m))
        put_text(self.picture, text, (column, row), colour, centred=True)


def put_text(
    picture: ByteArray,
    text: str,
    at: tuple[int, int],
    colour: Colour = WHITE,
    scale: float = 0.42,
    centred: bool = False,
) -> None:
    """Write outlined text with its lower left corner (or centre) at pixel (column, row), shifted into the image.

    The outline is black, that of black text white. OpenCV's fonts are ASCII only: other characters become question
    marks.
    """
    text = "".join(c if c.isascii() and c.isprintable() else "?" for c in text)
    (width, height), _ = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, scale, 1)
    column, row = (at[0] - width // 2, at[1] + height // 2) if centred else at
    column = min(max(column, 2), max(picture.shape[1] - width - 2, 2))
    row = min(max(row, height + 2), picture.shape[0] - 3)
    edge = WHITE if colour == BLACK else BLACK
    # The outline is the text shifted by a pixel: with a thicker stroke, OpenCV 5 spaces letters wider.
    for right, down, ink in ((-1, 0, edge), (1, 0, edge), (0, -1, edge), (0, 1, edge), (0, 0, colour)):
        at = (column + right, row + down)
        cv2.putText(picture, text, at, cv2.FONT_HERSHEY_SIMPLEX, scale, ink, 1, cv2.LINE_AA)


def caption(text: str, width: int) -> ByteArray:
    """Return a line of text as a picture (26, width, 3), black on white; a long one is written smaller."""
    line = np.full((_CAPTION_PX, width, 3), 255, np.uint8)
    (needed, _), _ = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, _CAPTION_SCALE, 1)
    put_text(line, text, (2, _CAPTION_PX - 8), BLACK, _CAPTION_SCALE * min(1.0, (width - 4) / needed))
    return line


# Edges of a box by the corner numbers of `Boxes.corners`; the last two mark the front.
_EDGES = [
    (0, 1),
    (1, 2),
    (2, 3),
    (3, 0),
    (4, 5),
    (5, 6),
    (6, 7),
    (7, 4),
    (0, 4),
    (1, 5),
    (2, 6),
    (3, 7),
    (0, 7),
    (3, 4),
]


def draw_box(picture: ByteArray, camera: Camera, corners_ego: FloatArray, colour: Colour, width: int = 2) -> bool:
    """Draw the corners (8, 3) of a box in the ego frame into a camera image, with a cross on its front face.

    Edges are clipped at the image plane. Return whether any edge was drawn.
    """
    corners = apply(inverse(camera.ego_from_cam), corners_ego)
    drawn = False
    for a, b in _EDGES:
        ends = _in_front(corners[a], corners[b])
        if ends is None:
            continue
        uv, _ = camera.project(ends)
        if np.abs(uv).max() > 1e5:
            continue
        (u0, v0), (u1, v1) = np.round(uv).astype(int).tolist()
        visible, start, end = cv2.clipLine((0, 0, camera.width_px, camera.height_px), (u0, v0), (u1, v1))
        if visible:
            cv2.line(picture, start, end, colour, width, cv2.LINE_AA)
            drawn = True
    return drawn


def _in_front(a: FloatArray, b: FloatArray, near_m: float = 0.2) -> FloatArray | None:
    """Clip a line in the camera frame to the part (2, 3) in front of the camera; None if there is none."""
    if max(a[2], b[2]) <= near_m:
        return None
    ends = []
    for this, other in ((a, b), (b, a)):
        share = 0.0 if this[2] > near_m else (near_m - this[2]) / (other[2] - this[2])
        ends.append(this + share * (other - this))
    return np.stack(ends)


def preview(bev: BEVMap, ego: EgoVehicle, scale: int = 4) -> ByteArray:
    """Return a preview of a map: appearance and occupancy side by side, forward up, captioned."""
    panels = []
    for what, title in PANELS.items():
        canvas = BEVCanvas(bev.grid, scale)
        getattr(canvas, what)(bev)
        canvas.ego(ego)
        put_text(canvas.picture, f"{title}; {PANEL_LEGEND}", (8, 18))
        panels.append(canvas.picture)
    return np.ascontiguousarray(np.hstack(panels))
