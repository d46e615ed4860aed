"""Tracks of key frames from a file of nuScenes tracking results."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field, ValidationError

from appocc.errors import DataError, ShapeError
from appocc.files import read_json
from appocc.geometry import rotation_from_quaternion, yaw_of
from appocc.jsonparts import JsonPart, first_problem
from appocc.motion_state import MOVING_MPS
from tracking.tracks import Track

_Three = Annotated[list[float], Field(min_length=3, max_length=3)]
_Four = Annotated[list[float], Field(min_length=4, max_length=4)]
_Two = Annotated[list[float], Field(min_length=2, max_length=2)]


class _Box(JsonPart):
    """A track; the last four keys are those that `tracking.io.writers` adds."""

    translation: _Three
    size: _Three
    rotation: _Four
    velocity: _Two
    tracking_id: str | int
    tracking_name: str
    tracking_score: float = 1.0
    rgb: _Three | None = None
    seen: bool = True
    heading_known: bool | None = None
    velocity_known: bool = True


class _Results(JsonPart):
    results: dict[str, list[_Box]]


def read_key_frame(path: Path, sample_token: str) -> tuple[Track, ...]:
    """Read the tracks of a key frame, see `read_tracks`.

    Raises:
        DataError: as `read_tracks`.
    """
    return read_tracks(path, [sample_token])[0]


def read_tracks(path: Path, sample_tokens: Sequence[str]) -> tuple[tuple[Track, ...], ...]:
    """Read the tracks of key frames; ids that are not numbers are replaced by indices from 1 in each.

    Raises:
        DataError: if the file cannot be read, is damaged, or lacks a key frame.
    """
    try:
        results = _Results.model_validate(read_json(path)).results
    except ValidationError as error:
        raise DataError(f"{path}: expected tracking results of nuScenes ({first_problem(error)})") from error
    return tuple(_tracks_of(path, results, token) for token in sample_tokens)


def _tracks_of(path: Path, results: dict[str, list[_Box]], sample_token: str) -> tuple[Track, ...]:
    if sample_token not in results:
        raise DataError(f"{path}: expected tracks of key frame {sample_token}, got none")
    try:
        return tuple(_track(number, box) for number, box in enumerate(results[sample_token], start=1))
    except ShapeError as error:
        raise DataError(f"{path}: key frame {sample_token}: {error}") from error


def _track(number: int, box: _Box) -> Track:
    width_m, length_m, height_m = box.size
    x, y, z = box.translation
    velocity = np.array(box.velocity)
    name = str(box.tracking_id)
    return Track(
        id=int(name) if name.isascii() and name.isdigit() else number,
        position_world_m=np.array([x, y, z - height_m / 2]),
        velocity_world_mps=velocity,
        yaw_world_rad=float(yaw_of(rotation_from_quaternion(box.rotation))),
        # Without the key, as in files of other trackers, headings distinguish front and rear.
        heading_known=box.heading_known is not False,
        length_m=length_m,
        width_m=width_m,
        rgb=np.array(box.rgb or [np.nan] * 3),
        score=box.tracking_score,
        seen=box.seen,
        height_m=height_m,
        kind=box.tracking_name,
        moving=box.velocity_known and bool(np.hypot(*velocity) > MOVING_MPS),
        velocity_known=box.velocity_known,
    )
