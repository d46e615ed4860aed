"""MOTChallenge text: a detector's boxes in for the tracker, tracks out.

Lines of detections are `frame,-1,left,top,width,height,conf[,x,y,z]`, boxes in pixels. The second column may hold
anything; x, y and z are where the feet stand, in metres, or -1,-1,-1 in all lines if that is not known.

- Where places are known, they are followed.
- Otherwise the middles of the boxes' lower edges are, x to the right and y up, in units in which the median box of
  the file is 1.7 m high: metres, roughly, as far as people are equally far away.

Confidences have no common scale. If all of a file lie in 0..1 they are taken as probabilities. Otherwise only their
order counts: with r the share of the file's confidences below one (equal ones count half), its log-odds are those of
r, and 1 more: the middle one is right in three of four cases. So are all if all are the same, -1 for example.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.stats import rankdata

from appocc.checks import FloatArray, IntArray, check_shape, frozen
from appocc.errors import DataError, ShapeError
from appocc.files import write_bytes
from tracking.association.costs import AssociationConfig
from tracking.detections import Around, Detections, log_odds_of
from tracking.filtering.kalman import MotionConfig
from tracking.io.text_tables import lines, numbers, whole
from tracking.track_table import LifeConfig
from tracking.tracker import TrackerConfig
from tracking.tracks import Track

KIND, PERSON_M = "pedestrian", 1.7
# Of a person's height; so large is the place that one stands on.
_FOOTPRINT = 0.3
# Log-odds of the detection in the middle of a file, where confidences tell the order alone: right in 3 of 4 cases.
_MIDDLE = 1.0
MOST_FRAMES, LEAST_FPS, MOST_FPS = 1_000_000, 0.01, 1000.0
_LEAST_COLUMNS, _ALL_COLUMNS = 7, 10


def _people(off_m: float, gate_m: float) -> TrackerConfig:
    """For people, whose places are off by so much (standard deviation).

    They go to any side, whatever is known of headings. They stand close, so that a track must not wait long to be
    found again, nor be told of where nobody is seen; the heights of boxes tell who is nearer.
    """
    near = AssociationConfig(
        gate_m=gate_m,
        gate_mps=4.0,
        gate_most_m=2.0,
        heading_cap=0.0,
        size=0.2,
        size_cap=9.0,
        cost_most=50.0,
    )
    motion = MotionConfig(
        speed_mps=1.0, drift_mps=1.0, push_m2ps3=0.1, swerve_m2ps3=0.1, along_m=off_m, across_m=off_m
    )
    life = LifeConfig(
        sure=2.2,
        confirm_s=0.15,
        coast_s=0.12,
        lost_s=1.0,
        forget_s=1.0,
        forget_resting_s=1.0,
        rest_mps=0,
        motion=motion,
    )
    return TrackerConfig(
        begin=0.5, life=life, association=near, again=replace(near, gate_squared=15.0), colour_doubt=1.0
    )


# Where feet stand in the picture is seen better than how far away that is on the ground.
PEOPLE_IN_PICTURES, PEOPLE_ON_GROUND = _people(0.1, 0.4), _people(0.2, 0.8)


@dataclass(frozen=True)
class MotFrame:
    """One frame.

    Attributes:
        number: as in the file.
        detections: N boxes.
        boxes_px: (N, 4) left, top, width, height of the same.
        timestamp_us: time since frame 0.
    """

    number: int
    detections: Detections
    boxes_px: FloatArray
    timestamp_us: int

    def __post_init__(self) -> None:
        """Check shapes.

        Raises:
            ShapeError: if one does not fit.
        """
        check_shape("frame boxes_px", self.boxes_px, (len(self.detections), 4))
        frozen(self.boxes_px)

    @property
    def world_from_ego(self) -> FloatArray:
        """(4, 4) identity: places are told in a frame that stands still."""
        return np.eye(4)


@dataclass(frozen=True)
class MotSequence:
    """The frames of a file, from the first with detections to the last.

    Attributes:
        frames: T, in order of time; empty ones in which a tracker remembers nobody are left out.
        px_per_m: pixels of a metre in the picture; None where places on the ground are followed.
    """

    frames: tuple[MotFrame, ...]
    px_per_m: float | None

    @property
    def config(self) -> TrackerConfig:
        """What a tracker of them needs."""
        return PEOPLE_ON_GROUND if self.px_per_m is None else PEOPLE_IN_PICTURES


# Reading ----------------------------------------------------------------------------------------------------------


def read_boxes(path: Path, fps: float) -> MotSequence:
    """The detections of a file, filmed with so many frames a second.

    Raises:
        DataError: if it cannot be read, is damaged or empty, or the frame rate is none.
    """
    if not LEAST_FPS <= fps <= MOST_FPS:
        raise DataError(f"expected {LEAST_FPS:g} .. {MOST_FPS:g} frames a second, got {fps:g}")
    rows, placed = _rows(path)
    if not len(rows):
        raise DataError(f"{path}: expected detections, got an empty file")
    first, last = int(rows[:, 0].min()), int(rows[:, 0].max())
    if last - first >= MOST_FRAMES:
        raise DataError(f"{path}: expected up to {MOST_FRAMES} frames, got {first} to {last}")
    px_per_m = None if placed else float(np.median(rows[:, 5])) / PERSON_M
    rows = rows[np.argsort(rows[:, 0], kind="stable")]
    rows[:, 6] = _log_odds(rows[:, 6])
    seen = _frames_near(rows[:, 0].astype(np.int64), fps)
    parts = np.split(rows, np.searchsorted(rows[:, 0], seen[1:]))
    try:
        frames = (_frame(int(number), part, fps, px_per_m) for number, part in zip(seen, parts, strict=True))
        return MotSequence(tuple(frames), px_per_m)
    except ShapeError as error:
        raise DataError(f"{path}: {error}") from error


def _frames_near(numbers: IntArray, fps: float) -> IntArray:
    """Numbers of the frames with detections, and of those after them until nobody is remembered any more."""
    seen = np.unique(numbers)
    # With the frame itself, and the first in which all are forgotten.
    remembered = int(np.ceil(PEOPLE_IN_PICTURES.life.forget_resting_s * fps)) + 2
    left = np.diff(seen, append=seen[-1] + 1).clip(max=remembered)
    after = np.arange(left.sum()) - np.repeat(np.cumsum(left) - left, left)
    return np.asarray(np.repeat(seen, left) + after)


def _rows(path: Path) -> tuple[FloatArray, bool]:
    """(R, 10) rows, x, y and z NaN where unknown, and whether they are known."""
    rows: list[list[float]] = []
    known: bool | None = None
    for place, columns in lines(path, ",", _LEAST_COLUMNS):
        row = numbers(place, columns[:_ALL_COLUMNS])
        whole(place, "frame", row[0], 0)
        if min(row[4:6]) <= 0:
            raise DataError(f"{place}: expected a positive width and height, got {row[4]:g} x {row[5]:g}")
        has = len(row) == _ALL_COLUMNS and row[7:] != [-1, -1, -1]
        if known is not None and has != known:
            wanted = "a place x,y,z" if known else "no place x,y,z"
            raise DataError(f"{place}: expected {wanted}, as in the lines before, got {'one' if has else 'none'}")
        known = has
        rows.append(row if has else [*row[:_LEAST_COLUMNS], *[np.nan] * 3])
    return np.array(rows).reshape(-1, _ALL_COLUMNS), bool(known)


def _log_odds(confidence: FloatArray) -> FloatArray:
    """(R,) log-odds of the confidences of a file."""
    if np.ptp(confidence) > 0 and confidence.min() >= 0 and confidence.max() <= 1:
        return log_odds_of(confidence)
    return log_odds_of((rankdata(confidence) - 0.5) / len(confidence)) + _MIDDLE


def _frame(number: int, rows: FloatArray, fps: float, px_per_m: float | None) -> MotFrame:
    boxes, n = rows[:, 2:6].copy(), len(rows)
    if px_per_m is None:
        ground, height = rows[:, 7:10].copy(), np.full(n, PERSON_M)
    else:
        ground = np.column_stack([_foot_px(boxes) * [1.0, -1.0] / px_per_m, np.zeros(n)])
        height = boxes[:, 3] / px_per_m
    unknown, no = np.full((n, 3), np.nan), np.zeros(n, dtype=np.bool_)
    size = np.column_stack([_FOOTPRINT * height, _FOOTPRINT * height, height])
    log_odds, kind = rows[:, 6].copy(), (KIND,) * n
    detections = Detections(ground, np.zeros(n), no, size, log_odds, kind, unknown, unknown, no, Around())
    return MotFrame(number, detections, boxes, round(number * 1e6 / fps))


def _foot_px(boxes_px: FloatArray) -> FloatArray:
    """(N, 2) column and row of the middles of the lower edges of boxes (N, 4)."""
    return boxes_px[:, :2] + boxes_px[:, 2:] * [0.5, 1.0]


# Writing ----------------------------------------------------------------------------------------------------------


def write_boxes(path: Path, sequence: MotSequence, tracks: Sequence[Sequence[Track]]) -> None:
    """Write rows `frame,id,left,top,width,height,conf,x,y,z`, pixels and metres; conf is the score, 0..1.

    Where a track was seen its box is the detection's. Where its place is predicted its last box is moved there in the
    picture, or stays, if places on the ground are followed; those are x, y and z, which else are -1. A track that no
    frame up to now showed has no box and is left out.

    Args:
        path: file to write.
        sequence: T frames.
        tracks: T tuples of tracks, as `tracking.detections.lead` returns them.

    Raises:
        DataError: if the file cannot be written.
    """
    last_px: dict[int, FloatArray] = {}
    rows = []
    for frame, moment in zip(sequence.frames, tracks, strict=True):
        for track in moment:
            box = _box_px(frame, track, last_px.get(track.id), sequence.px_per_m)
            if box is None:
                continue
            last_px[track.id] = box
            place = "-1,-1,-1" if sequence.px_per_m else ",".join(f"{x:.3f}" for x in track.position_world_m)
            measures = ",".join(f"{pixels:.2f}" for pixels in box)
            rows.append(f"{frame.number},{track.id},{measures},{track.score:.4f},{place}\n")
    write_bytes(path, "".join(rows).encode())


def _box_px(frame: MotFrame, track: Track, last_px: FloatArray | None, px_per_m: float | None) -> FloatArray | None:
    """(4,) left, top, width, height of a track; None if it was never seen."""
    if track.detection is not None:
        return np.asarray(frame.boxes_px[track.detection])
    if last_px is None or px_per_m is None:
        return last_px
    moved_px = track.position_world_m[:2] * [px_per_m, -px_per_m] - _foot_px(last_px[None])[0]
    return np.concatenate([last_px[:2] + moved_px, last_px[2:]])
