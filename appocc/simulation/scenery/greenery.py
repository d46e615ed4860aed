"""Trees, hedges and bushes along streets, in gardens and in parks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from scipy.ndimage import map_coordinates

from appocc.checks import FloatArray
from appocc.simulation.mesh import Material, Mesh
from appocc.simulation.scenery import palette
from appocc.simulation.scenery.builder import Builder, Tint, instance_mesh
from appocc.simulation.scenery.plots import Plot
from appocc.simulation.scenery.site import REACH_M, SITE_M, Site
from appocc.simulation.scenery.trees import Tree, broad_tree, bush, columnar_tree, conifer_tree, small_tree


@dataclass(frozen=True, kw_only=True)
class Planting:
    """Density and mix of the greenery of a style.

    Attributes:
        spacing_m: spacing of the trees in a dense garden or park.
        share: share of the spots near houses that have a tree.
        park_share: share of the spots away from houses.
        bushes: bushes per tree.
        hedges: share of the front gardens with a hedge or fence.
        conifers: share of conifers.
        near_m: distance from a street up to which trees are detailed; terraces hide those behind them.
    """

    spacing_m: float
    share: float
    park_share: float
    bushes: float
    hedges: float
    conifers: float
    near_m: float


PLANTINGS = {
    "old": Planting(spacing_m=7.5, share=0.22, park_share=0.36, bushes=0.5, hedges=0.0, conifers=0.1, near_m=9.0),
    "modern": Planting(
        spacing_m=8.5, share=0.26, park_share=0.36, bushes=0.8, hedges=0.1, conifers=0.12, near_m=12.0
    ),
    "suburb": Planting(
        spacing_m=7.5, share=0.34, park_share=0.42, bushes=0.9, hedges=0.75, conifers=0.22, near_m=13.0
    ),
    "industrial": Planting(
        spacing_m=11.0, share=0.16, park_share=0.3, bushes=0.6, hedges=0.6, conifers=0.2, near_m=14.0
    ),
}
_VARIANTS = 4


def plant_trees(site: Site, style: str, street_trees_m: FloatArray, rng: np.random.Generator) -> list[Mesh]:
    """Build trees and bushes as instances: street trees at positions (N, 2), gardens and parks by the style."""
    planting = PLANTINGS[style]
    spots = _garden_spots(site, planting, rng)
    far = site.distance_at(spots, site.to_road_m) > planting.near_m
    conifer_share = rng.random(len(spots)) < planting.conifers
    roll = rng.random(len(spots))
    meshes = _instance_trees(
        street_trees_m, (broad_tree,), palette.LEAVES, rng, 2.0, scale=(0.82, 0.98), slender=1.36
    )
    for distant, detail in ((False, 1.0), (True, 0.4)):
        here = far == distant
        leafy = here & ~conifer_share
        meshes += _instance_trees(
            spots[leafy & (roll < 0.5)], (broad_tree,), palette.LEAVES, rng, detail, (0.75, 1.3)
        )
        meshes += _instance_trees(
            spots[leafy & (roll >= 0.5) & (roll < 0.88)], (small_tree,), palette.LEAVES, rng, detail, (0.7, 1.3)
        )
        meshes += _instance_trees(
            spots[leafy & (roll >= 0.88)], (columnar_tree,), palette.LEAVES, rng, detail, (0.7, 1.2)
        )
        meshes += _instance_trees(
            spots[here & conifer_share], (conifer_tree,), palette.NEEDLES, rng, detail, (0.6, 1.3)
        )
    near = spots[~far]
    count = int(len(near) * planting.bushes)
    around = near[rng.integers(len(near), size=count)] if len(near) else near
    bushes = around + rng.uniform(-4.0, 4.0, around.shape)
    clear = (~site.is_set(bushes, site.occupied)) & (site.distance_at(bushes, site.to_paved_m) > 1.0)
    meshes += _instance_trees(bushes[clear], (lambda seed, _: bush(seed),), palette.HEDGES, rng, 1.0, (0.6, 1.4))
    return meshes


def _garden_spots(site: Site, planting: Planting, rng: np.random.Generator) -> FloatArray:
    """Return (N, 2) of a jittered, thinned grid away from walls and pavements; trunks keep their distance."""
    height, width = site.occupied.shape
    step = planting.spacing_m / SITE_M
    y, x = np.meshgrid(np.arange(0, height, step), np.arange(0, width, step), indexing="ij")
    grid = np.stack([x.ravel(), y.ravel()], axis=1) + rng.uniform(0, step, (x.size, 2))
    spots = site.low_m + grid * SITE_M
    to_taken = cv2.distanceTransform((site.occupied == 0).astype(np.uint8), cv2.DIST_L2, 3)
    clear = SITE_M * site.distance_at(spots, np.asarray(to_taken, dtype=np.float32))
    paved = site.distance_at(spots, site.to_paved_m)
    # Low-frequency noise makes some parks and gardens denser than others.
    coarse = grid[:, ::-1] / [height, width] * 11
    fullness = 0.4 + 1.2 * map_coordinates(rng.random((12, 12)), coarse.T, order=1, mode="nearest")
    share = np.where(clear < 9.0, planting.share, planting.park_share) * fullness
    keep = (clear > 2.0) & (paved > 1.6) & (paved < REACH_M - 4.0) & (rng.random(len(spots)) < share)
    return np.asarray(spots[keep])


def _instance_trees(
    xy_m: FloatArray,
    kinds: Sequence[Callable[[int, float], Tree]],
    tints: Sequence[Tint],
    rng: np.random.Generator,
    detail: float,
    scale: tuple[float, float],
    slender: float = 1.0,
) -> list[Mesh]:
    """Return instances at positions (N, 2) in several variants, sizes and shades; `slender` scales the height."""
    count = len(xy_m)
    variant = rng.integers(_VARIANTS, size=count)
    yaw = rng.uniform(0, 2 * np.pi, count)
    size = rng.uniform(*scale, (count, 1)) * rng.uniform(0.9, 1.1, (count, 3)) * [1.0, 1.0, slender]
    colours = np.array(tints)[rng.integers(len(tints), size=count)] * rng.uniform(0.88, 1.12, (count, 1))
    colours = np.clip(colours, 0, 255).astype(np.int64)
    meshes = []
    for number in range(_VARIANTS):
        these = variant == number
        if not these.any():
            continue
        tree = kinds[number % len(kinds)](number, detail)
        xyz = np.concatenate([xy_m[these], np.zeros((int(these.sum()), 1))], axis=1)
        meshes.append(instance_mesh(tree.mesh, xyz, yaw[these], size[these], colours[these], tree.leaves))
    return meshes


def add_enclosures(builder: Builder, site: Site, plots: Sequence[Plot], style: str, rng: np.random.Generator) -> None:
    """Add hedges and fences in front of gardens, with a gap for the path to the door."""
    share = PLANTINGS[style].hedges
    for plot in plots:
        if not plot.built or plot.backland or plot.front_m < 3.0 or rng.random() > share:
            continue
        d = -plot.front_m + 0.75
        gap = float(rng.uniform(0.45, 0.75)) * plot.width_m
        ends = [(-1.2, gap - 1.7), (gap + 1.7, plot.width_m + 1.2)]
        kind = rng.random()
        for s0, s1 in ends:
            outline = plot.frame.corners(s0, s1, d - 0.4, d + 0.4)
            if s1 - s0 < 0.8 or not site.is_free(outline):
                continue
            site.occupy(outline)
            if style == "industrial":
                _add_metal_fence(builder, plot, s0, s1, d)
            elif kind < 0.55:
                _add_hedge(builder, plot, s0, s1, d, rng)
            else:
                _add_picket_fence(builder, plot, s0, s1, d, rng)


def _add_hedge(builder: Builder, plot: Plot, s0: float, s1: float, d: float, rng: np.random.Generator) -> None:
    """Add a clipped hedge, slightly uneven along its length."""
    count = max(1, round((s1 - s0) / 1.6))
    cut = np.linspace(s0, s1, count + 1)
    height = float(rng.uniform(0.8, 1.5)) + rng.uniform(-0.05, 0.05, count)
    depth = 0.6 + rng.uniform(-0.06, 0.06, count)
    low = np.stack([cut[:-1], d - depth / 2, np.zeros(count)], axis=1)
    high = np.stack([cut[1:], d + depth / 2, height], axis=1)
    tint = palette.HEDGES[int(rng.integers(len(palette.HEDGES)))]
    builder.add_boxes(plot.frame, low, high, Material.HEDGE, tint)


def _add_picket_fence(builder: Builder, plot: Plot, s0: float, s1: float, d: float, rng: np.random.Generator) -> None:
    """Add a picket fence, or a low wall."""
    tint = palette.FENCES[int(rng.integers(len(palette.FENCES)))]
    if rng.random() < 0.35:
        brick = palette.BRICKS[int(rng.integers(len(palette.BRICKS)))]
        builder.add_boxes(plot.frame, [s0, d - 0.12, 0], [s1, d + 0.12, 0.75], Material.BRICK, brick)
        cap = [s0 - 0.03, d - 0.16, 0.75], [s1 + 0.03, d + 0.16, 0.83]
        builder.add_boxes(plot.frame, *cap, Material.CONCRETE, palette.STONE, sides="lrfbdt")
        return
    count = max(2, round((s1 - s0) / 1.9) + 1)
    s = np.linspace(s0, s1 - 0.1, count)
    low = np.stack([s, np.full(count, d - 0.05), np.zeros(count)], axis=1)
    builder.add_boxes(plot.frame, low, low + np.array([0.1, 0.1, 1.15]), Material.PLAIN, tint)
    for z in (0.12, 0.42, 0.72):
        builder.add_boxes(
            plot.frame, [s0, d - 0.07, z], [s1, d - 0.05, z + 0.22], Material.PLAIN, tint, sides="lrfbdt"
        )


def _add_metal_fence(builder: Builder, plot: Plot, s0: float, s1: float, d: float) -> None:
    """Add a metal fence with rails."""
    count = max(2, round((s1 - s0) / 2.8) + 1)
    s = np.linspace(s0, s1 - 0.06, count)
    low = np.stack([s, np.full(count, d - 0.03), np.zeros(count)], axis=1)
    builder.add_boxes(plot.frame, low, low + np.array([0.06, 0.06, 1.9]), Material.METAL, palette.METALS[0])
    for z in np.linspace(0.2, 1.8, 7):
        rail = [s0, d - 0.045, z], [s1, d - 0.03, z + 0.035]
        builder.add_boxes(plot.frame, *rail, Material.METAL, palette.METALS[0], sides="fbt")
