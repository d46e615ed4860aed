"""Readers of tracks and ground truth: nuScenes tracking JSON, MOTChallenge text and KITTI tracking text.

The format is detected from the content: JSON starts with a brace, MOTChallenge has commas, KITTI has spaces.

- nuScenes: `results` by sample token, a list of translation, tracking_id, tracking_name and an optional
  tracking_score. Positions are x and y of the global frame.
- MOTChallenge: `frame,id,left,top,width,height,conf,...`; boxes in the image. In ground truth, objects with conf 0
  are ignored. Columns after conf are not read.
- KITTI: `frame id type truncated occluded alpha left top right bottom h w l x y z ry [score]`. Positions are x and z
  of the camera. In ground truth, truncated objects (> 0) and those of unknown occlusion (> 2) are ignored.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
from pydantic import Field, ValidationError

from appocc.checks import FARTHEST_M, BoolArray, FloatArray
from appocc.errors import DataError
from appocc.files import open_plain, read_json
from appocc.jsonparts import JsonPart, first_problem
from appocc.text_tables import parse_integer, parse_numbers, read_rows

_KITTI_COLUMNS, _MOT_COLUMNS = 17, 7
DONT_CARE = "DontCare"


class TrackFormat(StrEnum):
    """Format of a file of tracks."""

    nuscenes = "nuScenes JSON"
    mot = "MOTChallenge text"
    kitti = "KITTI text"


@dataclass(frozen=True, eq=False)
class FrameEntries:
    """N objects or tracks of one frame.

    Attributes:
        ids: N ids, constant over time.
        kind: N categories; '' in MOTChallenge, which has none.
        xy_m: (N, 2) centres on the ground; NaN in MOTChallenge.
        box_px: (N, 4) left, top, right, bottom in the image; NaN in nuScenes.
        score: (N,) scores; NaN if there is none.
        required: (N,) whether an object of the ground truth must be tracked; the others are ignored.
    """

    ids: tuple[str, ...]
    kind: tuple[str, ...]
    xy_m: FloatArray
    box_px: FloatArray
    score: FloatArray
    required: BoolArray

    @classmethod
    def empty(cls) -> FrameEntries:
        """Return no entries."""
        return _entries([])

    def __len__(self) -> int:
        """Number of entries."""
        return len(self.ids)

    def select(self, keep: BoolArray) -> FrameEntries:
        """Return the entries of a mask (N,)."""
        index = np.flatnonzero(keep)
        names = tuple(self.ids[i] for i in index), tuple(self.kind[i] for i in index)
        return FrameEntries(*names, self.xy_m[index], self.box_px[index], self.score[index], self.required[index])


@dataclass(frozen=True, eq=False)
class TrackFile:
    """Content of a file of tracks.

    Attributes:
        path: path of the file.
        format: format of the file; None if it is empty.
        frames: entries by sample token (in the order of the file) or by frame number (ascending).
    """

    path: Path
    format: TrackFormat | None
    frames: Mapping[str | int, FrameEntries]


class _Entry(NamedTuple):
    """One object or track, see `FrameEntries`; `place` is its location for error messages."""

    place: str
    id: str
    kind: str
    xy_m: tuple[float, float] = (float("nan"), float("nan"))
    box_px: tuple[float, float, float, float] = (float("nan"),) * 4
    score: float = float("nan")
    required: bool = True


def read_track_file(path: Path) -> TrackFile:
    """Read a file of tracks or ground truth in any of the formats.

    Raises:
        DataError: if the file cannot be read or is damaged, or a frame has an id twice.
    """
    with open_plain(path) as file:
        start = file.read(4096).lstrip()
    if not start:
        return TrackFile(path, None, {})
    if start[:1] in b"{[":
        return TrackFile(path, TrackFormat.nuscenes, _read_nuscenes(path))
    if b"," in start.partition(b"\n")[0]:
        return TrackFile(path, TrackFormat.mot, _by_frame(_mot_entries(path)))
    return TrackFile(path, TrackFormat.kitti, _by_frame(_kitti_entries(path)))


def _entries(rows: Sequence[_Entry]) -> FrameEntries:
    """Return the entries of one frame.

    Raises:
        DataError: if an id occurs twice.
    """
    seen: set[str] = set()
    for row in rows:
        if row.id in seen and row.kind != DONT_CARE:
            raise DataError(f"{row.place}: expected each id once in a frame, got {row.id!r} twice")
        seen.add(row.id)
    return FrameEntries(
        tuple(row.id for row in rows),
        tuple(row.kind for row in rows),
        np.array([row.xy_m for row in rows], dtype=np.float64).reshape(-1, 2),
        np.array([row.box_px for row in rows], dtype=np.float64).reshape(-1, 4),
        np.array([row.score for row in rows], dtype=np.float64),
        np.array([row.required for row in rows], dtype=np.bool_),
    )


# nuScenes ---------------------------------------------------------------------------------------------------------


class _Box(JsonPart):
    translation: Annotated[list[float], Field(min_length=3, max_length=3)]
    tracking_id: str | int
    tracking_name: str
    tracking_score: float | None = None


class _Results(JsonPart):
    results: dict[str, list[_Box]]


def _read_nuscenes(path: Path) -> dict[str | int, FrameEntries]:
    try:
        results = _Results.model_validate(read_json(path)).results
    except ValidationError as error:
        raise DataError(f"{path}: expected tracking results of nuScenes ({first_problem(error)})") from error
    return {token: _entries([_box_entry(path, token, box) for box in boxes]) for token, boxes in results.items()}


def _box_entry(path: Path, token: str, box: _Box) -> _Entry:
    x, y, _ = box.translation
    place = f"{path}: sample {token}"
    if max(abs(x), abs(y)) > FARTHEST_M:
        raise DataError(f"{place}: expected places up to {FARTHEST_M:.0e} m, got {x:g}, {y:g}")
    score = float("nan") if box.tracking_score is None else box.tracking_score
    return _Entry(place=place, id=str(box.tracking_id), kind=box.tracking_name, xy_m=(x, y), score=score)


# Text -------------------------------------------------------------------------------------------------------------


def _by_frame(numbered: Iterator[tuple[int, _Entry]]) -> dict[str | int, FrameEntries]:
    frames: dict[int, list[_Entry]] = {}
    for frame, entry in numbered:
        frames.setdefault(frame, []).append(entry)
    return {frame: _entries(frames[frame]) for frame in sorted(frames)}


def _mot_entries(path: Path) -> Iterator[tuple[int, _Entry]]:
    for place, columns in read_rows(path, ",", _MOT_COLUMNS):
        frame, name, left, top, width, height, conf = parse_numbers(place, columns[:_MOT_COLUMNS])
        if min(width, height) <= 0:
            raise DataError(f"{place}: expected a positive width and height, got {width:g} x {height:g}")
        box_px = (left, top, left + width, top + height)
        entry = _Entry(
            place=place,
            id=str(parse_integer(place, "id", name)),
            kind="",
            box_px=box_px,
            score=conf,
            required=conf != 0,
        )
        yield parse_integer(place, "frame", frame), entry


def _kitti_entries(path: Path) -> Iterator[tuple[int, _Entry]]:
    for place, columns in read_rows(path, None, _KITTI_COLUMNS):
        frame, name, cut, occluded, _, left, top, right, bottom, *_, x, _, z, _ = parse_numbers(
            place, columns[:2] + columns[3:_KITTI_COLUMNS]
        )
        score = parse_numbers(place, columns[_KITTI_COLUMNS:][:1])
        entry = _Entry(
            place=place,
            id=str(parse_integer(place, "id", name)),
            kind=columns[2],
            xy_m=(x, z),
            box_px=(left, top, right, bottom),
            score=score[0] if score else float("nan"),
            required=cut <= 0 and occluded <= 2,
        )
        yield parse_integer(place, "frame", frame), entry
