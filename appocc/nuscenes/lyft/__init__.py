"""The coloured map of Lyft Level 5, whose tables have nuScenes' schema."""

from __future__ import annotations

from appocc.nuscenes.lyft.colours import LYFT_MAP, LYFT_SOURCE, drivable_grey

__all__ = ["LYFT_MAP", "LYFT_SOURCE", "drivable_grey"]
