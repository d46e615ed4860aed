"""Recorder for a running CARLA server (client interface 0.9.15): drives as scenes in the nuScenes schema.

Dosovitskiy et al., "CARLA: an open urban driving simulator", CoRL 2017. The package `carla` is imported lazily;
nothing here has run against a live server.
"""

from __future__ import annotations

from appocc.carla.drive import DriveSettings
from appocc.carla.record import record_drives

__all__ = ["DriveSettings", "record_drives"]
