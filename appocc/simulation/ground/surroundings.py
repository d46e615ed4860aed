"""What lies beside the streets: kerbs, pavements, yards, grass and earth."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import cv2
import numpy as np

from appocc.checks import ByteArray, Float32Array
from appocc.simulation.ground.areas import disc, islands, road_mask
from appocc.simulation.ground.filling import Canvas
from appocc.simulation.ground.noise import value_noise
from appocc.simulation.plan import TownPlan
from appocc.simulation.surface import CELL_M, Surface

_KERB_M = 0.2
# The ground beyond the kerb is decided in coarser cells, and noise in coarser ones still.
_COARSE = 2
_NOISE = 8
_BAND = 256
# Ground that roads enclose is an island, with grass and without a pavement, up to this area or this half width.
_ISLAND_M2 = 900.0
_ISLAND_HALF_M = 6.0
_LARGEST_ISLAND_M2 = 6000.0
_PAVED_HALF_M = 1.0


@dataclass(frozen=True)
class Look:
    """What a style puts beside its streets.

    Attributes:
        pavement_m: width of the pavement.
        yard_m: how far yards reach beyond the streets, on average.
        yard_share: share of that ground which is paved; the rest is grass.
        ragged_m: by how much that reach differs from place to place.
        earth: how rarely bare earth shows (in deviations of the noise).
    """

    pavement_m: float
    yard_m: float
    yard_share: float
    ragged_m: float
    earth: float


LOOKS: Mapping[str, Look] = {
    "old": Look(3.2, 22.0, 0.75, 7.0, 1.7),
    "modern": Look(3.6, 24.0, 0.55, 8.0, 2.1),
    "suburb": Look(2.2, 9.0, 0.18, 5.0, 1.6),
    "industrial": Look(2.4, 34.0, 0.8, 9.0, 1.2),
}


def draw_surroundings(canvas: Canvas, plan: TownPlan) -> None:
    """Fill everything that is no road yet; no pavement follows a country road's grass."""
    label = canvas.raster[:, :, 0]
    look = LOOKS.get(plan.style, LOOKS["old"])
    road = road_mask(label)
    small = cv2.resize(road, None, fx=1 / _COARSE, fy=1 / _COARSE, interpolation=cv2.INTER_NEAREST)
    away_m = np.asarray(cv2.distanceTransform(1 - small, cv2.DIST_L2, 5), dtype=np.float32)
    away_m *= _COARSE * CELL_M
    random = np.random.default_rng([plan.seed, 52])
    shape = (away_m.shape[0] // _NOISE + 2, away_m.shape[1] // _NOISE + 2)
    noises = [value_noise(random, shape, (12, 5, 2), (1.0, 0.6, 0.3)) for _ in range(3)]
    for first in range(0, len(away_m), _BAND):
        band = _band(label, road, away_m, first)
        _draw_band(band, away_m[first : first + _BAND], [_noise_band(n, first, away_m) for n in noises], look, road, first)
    _draw_islands(label, road, away_m)
    kerb = np.asarray(cv2.dilate(road, disc(_KERB_M)), dtype=np.uint8)
    label[(kerb > 0) & (road == 0)] = Surface.KERB


def _band(label: ByteArray, road: ByteArray, away_m: Float32Array, first: int) -> ByteArray:
    return label[first * _COARSE : (first + _BAND) * _COARSE]


def _noise_band(noise: Float32Array, first: int, away_m: Float32Array) -> Float32Array:
    rows = noise[first // _NOISE : first // _NOISE + _BAND // _NOISE + 1]
    fine = cv2.resize(rows, None, fx=_NOISE, fy=_NOISE, interpolation=cv2.INTER_LINEAR)
    height = min(_BAND, len(away_m) - first)
    return np.asarray(fine, dtype=np.float32)[:height, : away_m.shape[1]]
