"""Anybody's tracks and truth from files: nuScenes tracking JSON, MOTChallenge text and KITTI tracking text.

The format is told from the content: JSON begins with a brace, MOTChallenge has commas, KITTI has blanks.

- nuScenes: `results` by sample token, a list of translation, tracking_id, tracking_name and, if known,
  tracking_score. Places are x and y of the global frame.
- MOTChallenge: `frame,id,left,top,width,height,conf,...`; boxes in the image. In truth a conf of 0 means that the
  object is ignored; what follows conf is not looked at.
- KITTI: `frame id type truncated occluded alpha left top right bottom h w l x y z ry [score]`. Places are x and z of
  the camera. In truth, objects that are cut by the image (truncated > 0) or whose occlusion is unknown (> 2) are
  ignored.
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
from tracking.io.text_tables import lines, numbers, whole

_KITTI_COLUMNS, _MOT_COLUMNS = 17, 7
DONT_CARE = "DontCare"


class Format(StrEnum):
    """What a file of tracks is written in."""

    nuscenes = "nuScenes JSON"
    mot = "MOTChallenge text"
    kitti = "KITTI text"


@dataclass(frozen=True)
class Entries:
    """N objects or tracks of one frame.

    Attributes:
        ids: N names, the same over time.
        kind: N categories; '' in MOTChallenge, which has none.
        xy_m: (N, 2) centres on the ground; NaN in MOTChallenge.
        box_px: (N, 4) left, top, right, bottom in the image; NaN in nuScenes.
        score: (N,) NaN where there is none.
        demanded: (N,) whether, in truth, the object must be found.
    """

    ids: tuple[str, ...]
    kind: tuple[str, ...]
    xy_m: FloatArray
    box_px: FloatArray
    score: FloatArray
    demanded: BoolArray

    @classmethod
    def empty(cls) -> Entries:
        """None at all."""
        return _entries([])

    def __len__(self) -> int:
        """Number of them."""
        return len(self.ids)

    def select(self, keep: BoolArray) -> Entries:
        """Those of a mask (N,)."""
        index = np.flatnonzero(keep)
        names = tuple(self.ids[i] for i in index), tuple(self.kind[i] for i in index)
        return Entries(*names, self.xy_m[index], self.box_px[index], self.score[index], self.demanded[index])


@dataclass(frozen=True)
class TrackFile:
    """The content of a file.

    Attributes:
        path: where it is from.
        format: what it is written in; None if it is empty.
        frames: entries by sample token (in the order of the file) or by frame number (in order of time).
    """

    path: Path
    format: Format | None
    frames: Mapping[str | int, Entries]


class _Entry(NamedTuple):
    """One object or track, as `Entries`; `place` names it in errors."""

    place: str
    id: str
    kind: str
    xy_m: tuple[float, float] = (float("nan"), float("nan"))
    box_px: tuple[float, float, float, float] = (float("nan"),) * 4
    score: float = float("nan")
    demanded: bool = True


def read_tracks(path: Path) -> TrackFile:
    """Read a file of tracks or of truth in any of the formats.

    Raises:
        DataError: if it cannot be read or is damaged, or an id is there twice in a frame.
    """
    with open_plain(path) as file:
        start = file.read(4096).lstrip()
    if not start:
        return TrackFile(path, None, {})
    if start[:1] in b"{[":
        return TrackFile(path, Format.nuscenes, _read_nuscenes(path))
    if b"," in start.partition(b"\n")[0]:
        return TrackFile(path, Format.mot, _by_frame(_mot_entries(path)))
    return TrackFile(path, Format.kitti, _by_frame(_kitti_entries(path)))


def _entries(rows: Sequence[_Entry]) -> Entries:
    """The entries of one frame.

    Raises:
        DataError: if an id is there twice.
    """
    seen: set[str] = set()
    for row in rows:
        if row.id in seen and row.kind != DONT_CARE:
            raise DataError(f"{row.place}: expected each id once in a frame, got {row.id!r} twice")
        seen.add(row.id)
    return Entries(
        tuple(row.id for row in rows),
        tuple(row.kind for row in rows),
        np.array([row.xy_m for row in rows], dtype=np.float64).reshape(-1, 2),
        np.array([row.box_px for row in rows], dtype=np.float64).reshape(-1, 4),
        np.array([row.score for row in rows], dtype=np.float64),
        np.array([row.demanded for row in rows], dtype=np.bool_),
    )


# nuScenes ---------------------------------------------------------------------------------------------------------


class _Box(JsonPart):
    translation: Annotated[list[float], Field(min_length=3, max_length=3)]
    tracking_id: str | int
    tracking_name: str
    tracking_score: float | None = None


class _Results(JsonPart):
    results: dict[str, list[_Box]]


def _read_nuscenes(path: Path) -> dict[str | int, Entries]:
    try:
        results = _Results.model_validate(read_json(path)).results
    except ValidationError as error:
        raise DataError(f"{path}: expected tracking results of nuScenes ({first_problem(error)})") from error
    return {token: _entries([_of_box(path, token, box) for box in boxes]) for token, boxes in results.items()}


def _of_box(path: Path, token: str, box: _Box) -> _Entry:
    x, y, _ = box.translation
    place = f"{path}: sample {token}"
    if max(abs(x), abs(y)) > FARTHEST_M:
        raise DataError(f"{place}: expected places up to {FARTHEST_M:.0e} m, got {x:g}, {y:g}")
    score = float("nan") if box.tracking_score is None else box.tracking_score
    return _Entry(place, str(box.tracking_id), box.tracking_name, xy_m=(x, y), score=score)


# Text -------------------------------------------------------------------------------------------------------------


def _by_frame(numbered: Iterator[tuple[int, _Entry]]) -> dict[str | int, Entries]:
    frames: dict[int, list[_Entry]] = {}
    for frame, entry in numbered:
        frames.setdefault(frame, []).append(entry)
    return {frame: _entries(frames[frame]) for frame in sorted(frames)}


def _mot_entries(path: Path) -> Iterator[tuple[int, _Entry]]:
    for place, columns in lines(path, ",", _MOT_COLUMNS):
        frame, name, left, top, width, height, conf = numbers(place, columns[:_MOT_COLUMNS])
        if min(width, height) <= 0:
            raise DataError(f"{place}: expected a positive width and height, got {width:g} x {height:g}")
        box_px = (left, top, left + width, top + height)
        entry = _Entry(place, str(whole(place, "id", name)), "", box_px=box_px, score=conf, demanded=conf != 0)
        yield whole(place, "frame", frame), entry


def _kitti_entries(path: Path) -> Iterator[tuple[int, _Entry]]:
    for place, columns in lines(path, None, _KITTI_COLUMNS):
        frame, name, cut, occluded, _, left, top, right, bottom, *_, x, _, z, _ = numbers(
            place, columns[:2] + columns[3:_KITTI_COLUMNS]
        )
        score = numbers(place, columns[_KITTI_COLUMNS:][:1])
        entry = _Entry(
            place,
            str(whole(place, "id", name)),
            columns[2],
            xy_m=(x, z),
            box_px=(left, top, right, bottom),
            score=score[0] if score else float("nan"),
            demanded=cut <= 0 and occluded <= 2,
        )
        yield whole(place, "frame", frame), entry
