"""Simulated calibration of cameras: pictures of a checkerboard through any lens, and marked points on the ground."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from appocc.checks import ByteArray, FloatArray
from appocc.files import write_image
from appocc.geometry import apply, inverse
from appocc.rigs.source_camera import SourceCamera

CORNERS = (9, 6)
# Pixels of the printed board for a square; its white margin is a square wide.
_SQUARE_PX = 40


def board_picture(camera: SourceCamera, centre_m: Sequence[float], turn_rad: FloatArray) -> ByteArray:
    """A picture of a board of 0.1 m squares: where each pixel's ray meets it, at a place before the camera."""
    columns, rows = CORNERS[0] + 1, CORNERS[1] + 1
    cells = np.add.outer(np.arange(rows), np.arange(columns)) % 2
    board = np.full((rows + 2, columns + 2), 255, np.uint8)
    board[1:-1, 1:-1] = np.where(cells, 235, 20)
    texture = np.kron(board, np.ones((_SQUARE_PX, _SQUARE_PX), np.uint8))
    rotation = Rotation.from_rotvec(turn_rad).as_matrix()
    u, v = np.meshgrid(np.arange(camera.width_px), np.arange(camera.height_px))
    rays = camera.lens.unproject(np.stack([u, v], axis=-1).reshape(-1, 2).astype(np.float64))
    with np.errstate(invalid="ignore", divide="ignore"):
        distance = (rotation[:, 2] @ np.asarray(centre_m)) / (rays @ rotation[:, 2])
        places = (rays * distance[:, None] - centre_m) @ rotation[:, :2] / 0.1
    places = np.where((distance > 0)[:, None], places, 1e6)
    middle = np.array([texture.shape[1], texture.shape[0]]) / 2 - 0.5
    uv = (places * _SQUARE_PX + middle).reshape(camera.height_px, camera.width_px, 2).astype(np.float32)
    grey = cv2.remap(texture, uv[..., 0], uv[..., 1], cv2.INTER_AREA, borderMode=cv2.BORDER_CONSTANT, borderValue=120)
    return np.repeat(np.asarray(grey, np.uint8)[..., None], 3, axis=2)


def write_boards(folder: Path, camera: SourceCamera, count: int, wide: float = 0.9, near_m: float = 0.8) -> None:
    """Write pictures of a board before a camera; `wide` is how far to the sides, over the distance."""
    random = np.random.default_rng(0)
    for number in range(count):
        distance = random.uniform(near_m, 1.7 * near_m)
        across, down = random.uniform(-0.5, 0.5, 2) * [wide, 0.6 * wide] * distance
        image = board_picture(camera, [across, down, distance], random.uniform(-0.5, 0.5, 3))
        write_image(folder / camera.name / f"{number:02d}.png", image)


def marked_points(camera: SourceCamera, count: int, noise_px: float = 0.0) -> list[tuple[FloatArray, FloatArray]]:
    """(pixel, place) of points on the ground, 2 to 10 m from the camera, that it sees."""
    random = np.random.default_rng(1)
    x, y = camera.ego_from_cam[:2, 2]
    ahead = np.arctan2(y, x) + random.uniform(-0.9, 0.9, 400)
    away = random.uniform(2, 10, 400)
    places = np.stack([np.cos(ahead) * away, np.sin(ahead) * away, np.zeros(400)], axis=1)
    places[:, :2] += camera.ego_from_cam[:2, 3]
    pixels = camera.lens.project(apply(inverse(camera.ego_from_cam), places))
    seen = np.flatnonzero(camera.sees(pixels))[:count]
    assert len(seen) == count
    return [(pixels[i] + random.normal(0, noise_px, 2), places[i]) for i in seen]


def write_points(path: Path, cameras: Sequence[SourceCamera], count: int = 8, noise_px: float = 0.0) -> Path:
    """Write the marked points of cameras as a CSV file."""
    rows = [
        f"{camera.name},{u:.3f},{v:.3f},{x:.4f},{y:.4f}"
        for camera in cameras
        for (u, v), (x, y, _) in marked_points(camera, count, noise_px)
    ]
    path.write_text("camera,u,v,x,y\n" + "\n".join(rows) + "\n")
    return path
