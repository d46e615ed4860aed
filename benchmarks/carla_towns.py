"""Compare roads and lines drawn from CARLA's OpenDRIVE maps with CARLA's own rasters of the same towns.

Run: python -m benchmarks.carla_towns [TOWN ...]
The data folder (carla_towns/xodr, carla_towns/bev_h5) is ../shared/data next to the repository, or $APPOCC_DATA.
Needs SUMO.

Road: ours is every surface cars may drive on. CARLA's is its layer `road` (lanes for cars and junctions), together
with `parking`; its `shoulder` is road in neither. CARLA's raster shows streets of two lanes of 4.0 m as 9.0 m wide:
its roads reach RIM_M too far on all sides, and the second figure removes that rim. Remaining differences:
the middle lane for both directions in Town03 is road here, but not in CARLA's layer; junctions drawn here also cover
the median they reach across; lanes that begin at a tip (Town06) begin here with full width; and netconvert omits
some lanes of two loops of Town06.

Lines: share of our painted cells within TOLERANCE_M of one of CARLA's (hit), and of CARLA's within that of ours
(found; CARLA paints edge lines along small streets too, and ours are broken elsewhere than theirs).
"""

from __future__ import annotations

import argparse
import os
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import cv2
import h5py
import numpy as np

from appocc.checks import BoolArray, ByteArray, FloatArray
from appocc.simulation.ground import build_ground
from appocc.simulation.network import read_network
from appocc.simulation.plan import TownPlan
from appocc.simulation.surface import CELL_M, ROAD_SURFACES, Ground, Surface, surface_table
from appocc.simulation.town_generation.opendrive import import_opendrive

RIM_M = 0.5
# Two and a half pixels of CARLA's; our edge lines are 0.2 m inside the lane's edge, theirs on it.
TOLERANCE_M = 0.5
_TOWNS = tuple(f"Town0{k}" for k in range(1, 7))
_LINES = (Surface.LINE_WHITE, Surface.LINE_YELLOW)


@dataclass(frozen=True)
class Raster:
    """CARLA's raster of a town: layers (H, W), rows towards the south, columns towards the east."""

    road: BoolArray
    lines: BoolArray
    px_per_m: float
    offset_m: FloatArray


def read_raster(path: Path) -> Raster:
    with h5py.File(path) as file:
        layers = {name: np.asarray(file[name]) > 0 for name in ("road", "parking", "lane_marking_all")}
        px_per_m = float(file.attrs["pixels_per_meter"])
        offset_m = np.asarray(file.attrs["world_offset_in_meters"], dtype=np.float64)
    return Raster(layers["road"] | layers["parking"], layers["lane_marking_all"], px_per_m, offset_m)


def labels_like(raster: Raster, ground: Ground, offset_m: FloatArray) -> ByteArray:
    """Return our labels at the pixels of a raster; CARLA's y points south, and SUMO moved the map by `offset_m`."""
    height, width = raster.road.shape
    x_m = (np.arange(width) + 0.5) / raster.px_per_m + raster.offset_m[0] + offset_m[0]
    y_m = -((np.arange(height) + 0.5) / raster.px_per_m + raster.offset_m[1]) + offset_m[1]
    columns = np.floor((x_m - ground.low_m[0]) / CELL_M).astype(np.int64)
    rows = np.floor((y_m - ground.low_m[1]) / CELL_M).astype(np.int64)
    labels = np.zeros(raster.road.shape, np.uint8)
    here = (rows >= 0) & (rows < ground.label.shape[0]), (columns >= 0) & (columns < ground.label.shape[1])
    labels[np.ix_(*here)] = ground.label[np.ix_(rows[here[0]], columns[here[1]])]
    return labels


def iou(ours: BoolArray, theirs: BoolArray) -> float:
    return float((ours & theirs).sum() / (ours | theirs).sum())


def near(mask: BoolArray, reach_px: float) -> BoolArray:
    away = cv2.distanceTransform((~mask).astype(np.uint8), cv2.DIST_L2, 5)
    return np.asarray(away <= reach_px)


def compare(town: str, data: Path, folder: Path) -> str:
    network_file = folder / f"{town}.net.xml"
    import_opendrive(data / "xodr" / f"{town}.xodr", network_file)
    network = read_network(network_file)
    start_s = time.process_time()
    ground, _ = build_ground(TownPlan(town, 1, "modern", network))
    took_s = time.process_time() - start_s
    raster = read_raster(data / "bev_h5" / f"{town}.h5")
    labels = labels_like(raster, ground, network.offset_m)
    road, lines = (surface_table(kind)[labels] for kind in (ROAD_SURFACES, _LINES))
    rimless = ~near(~raster.road, RIM_M * raster.px_per_m)
    reach_px = TOLERANCE_M * raster.px_per_m
    hit = float((lines & near(raster.lines, reach_px)).sum() / lines.sum())
    found = float((raster.lines & near(lines, reach_px)).sum() / raster.lines.sum())
    high, wide = (size * CELL_M for size in ground.label.shape)
    return (
        f"{town}  {wide:4.0f} x {high:3.0f} m  {took_s:4.1f} s   road IoU {iou(road, raster.road):.3f}, "
        f"without CARLA's rim {iou(road, rimless):.3f}   "
        f"lines within {TOLERANCE_M} m: hit {hit:.2f}, found {found:.2f}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("towns", nargs="*", metavar="TOWN", help="Town01 ... Town06; all by default")
    beside = Path(__file__).resolve().parents[2] / "shared" / "data"
    data = Path(os.environ.get("APPOCC_DATA", beside)) / "carla_towns"
    with tempfile.TemporaryDirectory() as folder:
        for town in parser.parse_args().towns or _TOWNS:
            print(compare(town, data, Path(folder)), flush=True)


if __name__ == "__main__":
    main()
