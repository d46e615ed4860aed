"""What Lyft Level 5's dataset has beside nuScenes' schema: a coloured map."""

from __future__ import annotations

from appocc.nuscenes.lyft.colours import LYFT_MAP, LYFT_SOURCE, drivable_grey

__all__ = ["LYFT_MAP", "LYFT_SOURCE", "drivable_grey"]
