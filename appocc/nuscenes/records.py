"""Typed records of the tables that users walk through; tokens are str, times integer microseconds."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Scene:
    """A recording of some seconds: its name, and the ends of its chain of samples."""

    token: str
    name: str
    description: str
    log_token: str
    first_sample_token: str
    last_sample_token: str


@dataclass(frozen=True)
class Sample:
    """A key frame: the moment for which all sensors and boxes are given."""

    token: str
    timestamp_us: int
    scene_token: str
    prev: str
    next: str


@dataclass(frozen=True)
class SampleData:
    """One file of one sensor, with the pose and calibration rows that belong to it."""

    token: str
    sample_token: str
    channel: str
    modality: str
    timestamp_us: int
    is_key_frame: bool
    filename: str
    width_px: int
    height_px: int
    ego_pose_row: int
    calibration_row: int


@dataclass(frozen=True)
class MapRecord:
    """A drivable-area mask.

    Attributes:
        filename: picture below the root, 10 px a metre.
        origin_m: world (x, y) of its lower left corner; (0, 0) in nuScenes.
        unknown_value: grey value that means "not known", None where every pixel is known.
        source: what it was made from; empty for a published map.
    """

    filename: str
    origin_m: tuple[float, float]
    unknown_value: int | None
    source: str
