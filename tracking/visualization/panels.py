"""The parts of a picture of tracks: bird's-eye view, cameras, list."""

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
from tracking.io.writers import HEIGHT_M, class_of
from tracking.tracks import Track
from tracking.visualization.labels import Labels, put_chip

LIST_ROW_PX, LIST_COLUMN_PX = 22, 240


def ink_of(number: int) -> Colour:
    """A bright colour for an id; neighbouring ids get hues far apart."""
    red, green, blue = colorsys.hsv_to_rgb(number * 0.618034 % 1.0, 0.5, 1.0)
    return (round(red * 255), round(green * 255), round(blue * 255))


def footprint_world(track: Track) -> FloatArray:
    """(4, 3) corners on the ground, counter-clockwise from front left."""
    x, y, z = track.position_world_m.tolist()
    corners = footprints([x, y], track.yaw_world_rad, [track.length_m, track.width_m])
    return np.pad(corners, ((0, 0), (0, 1)), constant_values=z)


def corners_world(track: Track) -> FloatArray:
    """(8, 3) corners as in `Boxes.corners`; the height is the usual one of its class."""
    low = footprint_world(track)
    height = HEIGHT_M[class_of(track.length_m, track.width_m)]
    return np.concatenate([low, low + np.array([0.0, 0.0, height])])


def distances_m(tracks: Sequence[Track], world_from_ego: FloatArray) -> FloatArray:
    """(N, 3) places in the ego frame: x is the longitudinal distance."""
    places = np.array([track.position_world_m for track in tracks]).reshape(-1, 3)
    return apply(inverse(world_from_ego), places)


def nearest_first(tracks: Sequence[Track], world_from_ego: FloatArray) -> list[Track]:
    """The tracks in order of distance from the ego."""
    order = np.argsort(np.linalg.norm(distances_m(tracks, world_from_ego)[:, :2], axis=1), kind="stable")
    return [tracks[i] for i in order]


def bev_panel(
    bev: BEVMap,
    tracks: Sequence[Track],
    trails: dict[int, FloatArray],
    world_from_ego: FloatArray,
    ego: EgoVehicle,
    scale: int = 4,
) -> ByteArray:
    """The map with boxes, trails (id -> (K, 3) world), ids, mean colours and longitudinal distances; forward up."""
    canvas = BEVCanvas(bev.grid, scale)
    canvas.appearance(bev)
    put_text(canvas.picture, UNKNOWN_LEGEND, (8, canvas.picture.shape[0] - 8))
    canvas.ego(ego)
    ego_from_world = inverse(world_from_ego)
    ordered = nearest_first(tracks, world_from_ego)
    boxes = []
    for track in ordered:
        ink = ink_of(track.id)
        canvas.line(apply(ego_from_world, trails[track.id])[:, :2], ink, 1)
        corners = apply(ego_from_world, footprint_world(track))[:, :2]
        canvas.line(corners, ink, 2 if track.seen else 1, closed=True)
        pixels = canvas.pixel(corners)
        boxes.append(np.concatenate([pixels.min(axis=0), pixels.max(axis=0)]).astype(np.float64))
        if track.heading_known:
            canvas.line([corners[[0, 3]].mean(axis=0), corners.mean(axis=0)], ink, 2)
    labels = Labels(canvas.picture, np.array(boxes).reshape(-1, 4))
    for track, place in zip(ordered, distances_m(ordered, world_from_ego), strict=True):
        column, row = (int(v) for v in canvas.pixel(place[:2]))
        labels.put((column, row), f"{track.id}: {place[0]:.1f}m", ink_of(track.id), track.rgb, 5 * scale)
    return canvas.picture


def camera_panel(
    image: ByteArray, camera: Camera, tracks: Sequence[Track], world_from_ego: FloatArray, size_px: tuple[int, int]
) -> ByteArray:
    """A camera's picture at (width, height) with the boxes of tracks, ids and mean colours."""
    picture: ByteArray = cv2.resize(image, size_px, interpolation=cv2.INTER_AREA).astype(np.uint8)
    small = camera.resized(*size_px)
    ego_from_world = inverse(world_from_ego)
    shown = []
    for track in reversed(nearest_first(tracks, world_from_ego)):
        corners = apply(ego_from_world, corners_world(track))
        if draw_box(picture, small, corners, ink_of(track.id), 1):
            shown.append((track, corners[4:].mean(axis=0)))
    labels = Labels(picture)
    for track, top in reversed(shown):
        uv, depth = small.project_ego(top[None])
        if small.sees(uv, depth)[0]:
            labels.put((int(uv[0, 0]), int(uv[0, 1])), str(track.id), ink_of(track.id), track.rgb, 2)
    put_text(picture, camera.channel, (6, size_px[1] - 8), WHITE)
    return picture


def list_panel(tracks: Sequence[Track], world_from_ego: FloatArray, size_px: tuple[int, int]) -> ByteArray:
    """The nearest tracks as a list at (width, height): id, mean colour, class, distance ahead, speed."""
    width, height = size_px
    picture: ByteArray = np.full((height, width, 3), 24, np.uint8)
    rows, columns = height // LIST_ROW_PX, width // LIST_COLUMN_PX
    ordered = nearest_first(tracks, world_from_ego)[: rows * columns]
    for i, (track, place) in enumerate(zip(ordered, distances_m(ordered, world_from_ego), strict=True)):
        left, top = i // rows * LIST_COLUMN_PX + 8, i % rows * LIST_ROW_PX
        put_chip(picture, (left, top + 4), track.rgb, 14)
        name = class_of(track.length_m, track.width_m)
        text = f"{track.id}: {name} {place[0]:.1f}m, {track.speed_mps:.1f}m/s"
        put_text(picture, text, (left + 20, top + 16), ink_of(track.id), 0.45)
    return picture
