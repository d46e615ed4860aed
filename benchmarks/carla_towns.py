"""Streets drawn from CARLA's maps against CARLA's own rasters of the same towns.

Run: python -m benchmarks.carla_towns [TOWN ...]
The data folder (OpenDRIVE maps and rasters) is ../shared/data/carla_towns beside the repository, or in $APPOCC_DATA.

Road: CARLA's layers `road` (lanes for cars, junctions) and, where the map has them, `parking` and `shoulder`; ours: every
surface cars may drive on. CARLA's layers were drawn with a rim of some decimetres. Lane markings: share of ours within
TOLERANCE_M of one of CARLA's, and of CARLA's within that of ours, outside junctions (CARLA paints lines across them).
"""

from __future__ import annotations
