"""Argoverse 2 Sensor Dataset (Wilson et al., NeurIPS 2021), in its published folder layout."""

from __future__ import annotations

from appocc.importers.argoverse.log import ArgoverseLog, find_logs

__all__ = ["ArgoverseLog", "find_logs"]
