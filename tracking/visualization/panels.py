"""Panels of the track video: bird's-eye view, cameras, and list of tracks."""

from __future__ import annotations

import colorsys
from collections.abc import Sequence

import cv2
import numpy as np

from appocc.bevmap import BEVMap
from appocc.camera import Camera
from appocc.checks import ByteArray, FloatArray
from appocc.ego_vehicle import EgoVehicle
from appocc.geometry import apply, footprints, inverse
from appocc.visualization.canvas import UNKNOWN_LEGEND, WHITE, BEVCanvas, Colour, draw_box, put_text
from appocc.visualization.labels import LabelPlacer, draw_colour_chip
from tracking.tracks import Track
from tracking.vehicle_classes import HEIGHT_M, class_from_size

LIST_ROW_PX, LIST_COLUMN_PX = 22, 240
# What the signs of the bird's-eye view mean; the list of tracks tells their classes.
LEGEND = (
    "green: our own car",
    "a colour for each track; thin: not seen now",
    "inside a box: where it faces; tail: its way",
    "number: id, metres ahead; square: its paint",
    UNKNOWN_LEGEND,
)


def track_colour(number: int) -> Colour:
    """Return a bright colour for a track id; consecutive ids differ in hue."""
    red, green, blue = colorsys.hsv_to_rgb(number * 0.618034 % 1.0, 0.5, 1.0)
    return (round(red * 255), round(green * 255), round(blue * 255))


def footprint_world(track: Track) -> FloatArray:
    """Return the corners (4, 3) on the ground, counter-clockwise from front left."""
    x, y, z = track.position_world_m.tolist()
    corners = footprints([x, y], track.yaw_world_rad, [track.length_m, track.width_m])
    return np.pad(corners, ((0, 0), (0, 1)), constant_values=z)


def corners_world(track: Track) -> FloatArray:
    """Return the corners (8, 3), ordered as in `Boxes.corners`; an unknown height is that of the class."""
    low = footprint_world(track)
    height = track.height_m if np.isfinite(track.height_m) else HEIGHT_M.get(_class_of(track), HEIGHT_M["car"])
    return np.concatenate([low, low + np.array([0.0, 0.0, height])])


def positions_ego_m(tracks: Sequence[Track], world_from_ego: FloatArray) -> FloatArray:
    """Return the positions (N, 3) in the ego frame: x is the longitudinal distance."""
    positions = np.array([track.position_world_m for track in tracks]).reshape(-1, 3)
    return apply(inverse(world_from_ego), positions)


def sort_by_distance(tracks: Sequence[Track], world_from_ego: FloatArray) -> list[Track]:
    """Return the tracks by increasing distance from the ego."""
    order = np.argsort(np.linalg.norm(positions_ego_m(tracks, world_from_ego)[:, :2], axis=1), kind="stable")
    return [tracks[i] for i in order]


def draw_bev_panel(
    bev: BEVMap,
    tracks: Sequence[Track],
    trails: dict[int, FloatArray],
    world_from_ego: FloatArray,
    ego: EgoVehicle,
    scale: int = 4,
) -> ByteArray:
    """Draw the map, forward up, with boxes, trails (id -> (K, 3) world), ids, colours and longitudinal distances."""
    canvas = BEVCanvas(bev.grid, scale)
    canvas.appearance(bev)
    for line, text in enumerate(reversed(LEGEND)):
        put_text(canvas.picture, text, (8, canvas.picture.shape[0] - 8 - 18 * line))
    canvas.ego(ego)
    ego_from_world = inverse(world_from_ego)
    ordered = sort_by_distance(tracks, world_from_ego)
    boxes = []
    for track in ordered:
        ink = track_colour(track.id)
        canvas.line(apply(ego_from_world, trails[track.id])[:, :2], ink, 1)
        corners = apply(ego_from_world, footprint_world(track))[:, :2]
        canvas.line(corners, ink, 2 if track.seen else 1, closed=True)
        pixels = canvas.pixel(corners)
        boxes.append(np.concatenate([pixels.min(axis=0), pixels.max(axis=0)]).astype(np.float64))
        if track.heading_known:
            canvas.line([corners[[0, 3]].mean(axis=0), corners.mean(axis=0)], ink, 2)
    labels = LabelPlacer(canvas.picture, np.array(boxes).reshape(-1, 4))
    for track, place in zip(ordered, positions_ego_m(ordered, world_from_ego), strict=True):
        column, row = (int(v) for v in canvas.pixel(place[:2]))
        labels.put((column, row), f"{track.id}: {place[0]:.1f}m", track_colour(track.id), track.rgb, 5 * scale)
    return canvas.picture


def draw_camera_panel(
    image: ByteArray, camera: Camera, tracks: Sequence[Track], world_from_ego: FloatArray, size_px: tuple[int, int]
) -> ByteArray:
    """Draw a camera image at (width, height) with boxes, ids and mean colours of tracks."""
    picture: ByteArray = cv2.resize(image, size_px, interpolation=cv2.INTER_AREA).astype(np.uint8)
    small = camera.resized(*size_px)
    ego_from_world = inverse(world_from_ego)
    shown = []
    for track in reversed(sort_by_distance(tracks, world_from_ego)):
        corners = apply(ego_from_world, corners_world(track))
        if draw_box(picture, small, corners, track_colour(track.id), 1):
            shown.append((track, corners[4:].mean(axis=0)))
    labels = LabelPlacer(picture)
    for track, top in reversed(shown):
        uv, depth = small.project_ego(top[None])
        if small.sees(uv, depth)[0]:
            labels.put((int(uv[0, 0]), int(uv[0, 1])), str(track.id), track_colour(track.id), track.rgb, 2)
    put_text(picture, camera.channel, (6, size_px[1] - 8), WHITE)
    return picture


def draw_list_panel(tracks: Sequence[Track], world_from_ego: FloatArray, size_px: tuple[int, int]) -> ByteArray:
    """Draw a list of the nearest tracks at (width, height): id, mean colour, class, metres ahead, speed if known."""
    width, height = size_px
    picture: ByteArray = np.full((height, width, 3), 24, np.uint8)
    rows, columns = height // LIST_ROW_PX, width // LIST_COLUMN_PX
    ordered = sort_by_distance(tracks, world_from_ego)[: rows * columns]
    for i, (track, place) in enumerate(zip(ordered, positions_ego_m(ordered, world_from_ego), strict=True)):
        left, top = i // rows * LIST_COLUMN_PX + 8, i % rows * LIST_ROW_PX
        draw_colour_chip(picture, (left, top + 4), track.rgb, 14)
        speed = f"{track.speed_mps:.1f}m/s" if track.velocity_known else "speed?"
        text = f"{track.id}: {_class_of(track)} {place[0]:.1f}m, {speed}"
        put_text(picture, text, (left + 20, top + 16), track_colour(track.id), 0.45)
    return picture


def _class_of(track: Track) -> str:
    """Return the category of a track, or the class by its size if the category is "vehicle"."""
    return class_from_size(track.length_m, track.width_m) if track.kind == "vehicle" else track.kind
