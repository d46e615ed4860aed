"""Typed records of the main tables; tokens are str, times integer microseconds."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Scene:
    """A continuous drive, with the first and last token of its chain of samples."""

    token: str
    name: str
    description: str
    log_token: str
    first_sample_token: str
    last_sample_token: str


@dataclass(frozen=True)
class Sample:
    """A key frame: one annotated moment with the files of all sensors."""

    token: str
    timestamp_us: int
    scene_token: str
    prev: str
    next: str


@dataclass(frozen=True, kw_only=True)
class SampleData:
    """One sensor file, with the rows of its ego pose and calibration."""

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


# Category of the map row of a log without a map.
NO_MAP = "none"


@dataclass(frozen=True)
class MapRecord:
    """A drivable-area mask.

    Attributes:
        filename: image below the root, 10 px per metre.
        origin_m: world (x, y) of its lower left corner; (0, 0) in nuScenes.
        unknown_value: grey value of unknown pixels; None if all pixels are known.
        source: source that it was derived from; empty for a published map.
    """

    filename: str
    origin_m: tuple[float, float]
    unknown_value: int | None
    source: str
