"""MOTChallenge text: detections of people in, tracks out.

Detections are lines `frame,-1,left,top,width,height,conf[,x,y,z]` with boxes in pixels. The second column is ignored;
x, y and z are foot points in metres, or -1,-1,-1 in all lines if unknown.

- Known foot points are tracked on the ground.
- Otherwise the bottom centres of the boxes are tracked, x to the right and y up, scaled so that the median box of the
  file is 1.7 m high: roughly metres if all people are equally far away.

Confidences have no common scale. If all of a file are in 0..1, they are taken as probabilities. Otherwise only their
order is used: if r is the fraction of lower confidences in the file (ties count half), the log-odds are those of r
plus 1, which gives the median detection a precision of three in four. This includes files with equal confidences.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from appocc.checks import FloatArray, IntArray, check_shape, frozen
from appocc.errors import DataError, ShapeError
from appocc.files import write_bytes
from appocc.text_tables import parse_integer, parse_numbers, read_rows
from tracking.detections import Detections, log_odds_from_probability
from tracking.field_of_view import CircularView
from tracking.tracks import Track

KIND, PERSON_M = "pedestrian", 1.7
# Width and length of a person's footprint as a fraction of the height.
_FOOTPRINT = 0.3
# Log-odds of a file's median confidence where only the order of confidences is known: a precision of 3 in 4.
_MEDIAN_LOG_ODDS = 1.0
# A tracker of people forgets them after this time without a detection.
FORGET_S = 1.0
# Least weight of the newest box in the size of a track in the image; the first ones count alike.
_SIZE_GAIN = 0.4
MAX_FRAMES, MIN_FPS, MAX_FPS = 1_000_000, 0.01, 1000.0
_MIN_COLUMNS, _ALL_COLUMNS = 7, 10


@dataclass(frozen=True, eq=False)
class MotFrame:
    """Detections of one frame.

    Attributes:
        number: frame number in the file.
        detections: N detections.
        boxes_px: (N, 4) left, top, width, height of their boxes.
        timestamp_us: time since frame 0.
    """

    number: int
    detections: Detections
    boxes_px: FloatArray
    timestamp_us: int

    def __post_init__(self) -> None:
        """Check shapes.

        Raises:
            ShapeError: if a shape differs.
        """
        check_shape("frame boxes_px", self.boxes_px, (len(self.detections), 4))
        boxes_px = self.boxes_px.copy()
        frozen(boxes_px)
        object.__setattr__(self, "boxes_px", boxes_px)

    @property
    def world_from_ego(self) -> FloatArray:
        """(4, 4) identity: the camera is assumed to be static."""
        return np.eye(4)


@dataclass(frozen=True, eq=False)
class MotSequence:
    """Frames of a file, from the first to the last one with detections.

    Attributes:
        frames: T frames in temporal order; frames without detections are dropped after `FORGET_S`.
        px_per_m: pixels per metre in the image; None if foot points on the ground are known.
    """

    frames: tuple[MotFrame, ...]
    px_per_m: float | None


# Reading ----------------------------------------------------------------------------------------------------------


def read_mot_detections(path: Path, fps: float) -> MotSequence:
    """Read the detections of a file, given its frame rate.

    Raises:
        DataError: if the file cannot be read, is damaged or empty, or the frame rate is invalid.
    """
    if not MIN_FPS <= fps <= MAX_FPS:
        raise DataError(f"expected {MIN_FPS:g} .. {MAX_FPS:g} frames a second, got {fps:g}")
    rows, on_ground = _rows(path)
    if not len(rows):
        raise DataError(f"{path}: expected detections, got an empty file")
    first, last = int(rows[:, 0].min()), int(rows[:, 0].max())
    if last - first >= MAX_FRAMES:
        raise DataError(f"{path}: expected up to {MAX_FRAMES} frames, got {first} to {last}")
    px_per_m = None if on_ground else float(np.median(rows[:, 5])) / PERSON_M
    rows = rows[np.argsort(rows[:, 0], kind="stable")]
    rows[:, 6] = _log_odds(rows[:, 6])
    kept = _kept_frames(rows[:, 0].astype(np.int64), fps)
    parts = np.split(rows, np.searchsorted(rows[:, 0], kept[1:]))
    try:
        frames = (_frame(int(number), part, fps, px_per_m) for number, part in zip(kept, parts, strict=True))
        return MotSequence(tuple(frames), px_per_m)
    except ShapeError as error:
        raise DataError(f"{path}: {error}") from error


def _kept_frames(frame_numbers: IntArray, fps: float) -> IntArray:
    """Return the numbers of frames with detections, and of those after them until all tracks are forgotten."""
    detected = np.unique(frame_numbers)
    # Includes the frame itself, and the first one in which all tracks are forgotten.
    most = int(np.ceil(FORGET_S * fps)) + 2
    count = np.diff(detected, append=detected[-1] + 1).clip(max=most)
    after = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    return np.asarray(np.repeat(detected, count) + after)


def _rows(path: Path) -> tuple[FloatArray, bool]:
    """Return rows (R, 10), with NaN for unknown x, y and z, and whether these are known."""
    rows: list[list[float]] = []
    known: bool | None = None
    for place, columns in read_rows(path, ",", _MIN_COLUMNS):
        if len(columns) > _ALL_COLUMNS:
            raise DataError(f"{place}: expected at most {_ALL_COLUMNS} columns, got {len(columns)}")
        row = parse_numbers(place, columns)
        parse_integer(place, "frame", row[0], 0)
        if min(row[4:6]) <= 0:
            raise DataError(f"{place}: expected a positive width and height, got {row[4]:g} x {row[5]:g}")
        has = len(row) == _ALL_COLUMNS and row[7:] != [-1, -1, -1]
        if known is not None and has != known:
            wanted = "a place x,y,z" if known else "no place x,y,z"
            raise DataError(f"{place}: expected {wanted}, as in the lines before, got {'one' if has else 'none'}")
        known = has
        rows.append(row if has else [*row[:_MIN_COLUMNS], *[np.nan] * 3])
    return np.array(rows).reshape(-1, _ALL_COLUMNS), bool(known)


def _log_odds(confidence: FloatArray) -> FloatArray:
    """Return log-odds (R,) from the confidences of a file."""
    from scipy.stats import rankdata  # slow import, only needed here

    if np.ptp(confidence) > 0 and confidence.min() >= 0 and confidence.max() <= 1:
        return log_odds_from_probability(confidence)
    return log_odds_from_probability((rankdata(confidence) - 0.5) / len(confidence)) + _MEDIAN_LOG_ODDS


def _frame(number: int, rows: FloatArray, fps: float, px_per_m: float | None) -> MotFrame:
    boxes, n = rows[:, 2:6].copy(), len(rows)
    if px_per_m is None:
        ground, height = rows[:, 7:10].copy(), np.full(n, PERSON_M)
    else:
        ground = np.column_stack([_foot_px(boxes) * [1.0, -1.0] / px_per_m, np.zeros(n)])
        height = boxes[:, 3] / px_per_m
    unknown, no = np.full((n, 3), np.nan), np.zeros(n, dtype=np.bool_)
    detections = Detections(
        ground_m=ground,
        yaw_rad=np.zeros(n),
        heading_known=no,
        size_m=np.column_stack([_FOOTPRINT * height, _FOOTPRINT * height, height]),
        log_odds=rows[:, 6],
        kind=(KIND,) * n,
        rgb=unknown,
        lab=unknown,
        velocity_mps=unknown[:, :2],
        truncated=no,
        view=CircularView(),
    )
    return MotFrame(number, detections, boxes, round(number * 1e6 / fps))


def _foot_px(boxes_px: FloatArray) -> FloatArray:
    """Return the bottom centres (N, 2), column and row, of boxes (N, 4)."""
    return boxes_px[:, :2] + boxes_px[:, 2:] * [0.5, 1.0]


# Writing ----------------------------------------------------------------------------------------------------------


def write_mot_tracks(path: Path, sequence: MotSequence, tracks: Sequence[Sequence[Track]]) -> None:
    """Write rows `frame,id,left,top,width,height,conf,x,y,z`, pixels and metres; conf is the score, 0..1.

    If foot points on the ground are tracked, they are x, y and z, which otherwise are -1, and the box of a track is
    that of its last detection. In the image, the box stands on the track's position, which is filtered, and its size
    is smoothed. Tracks without any detection so far have no box and are not written.

    Args:
        path: file to write.
        sequence: T frames.
        tracks: T tuples of tracks, one per frame.

    Raises:
        DataError: if the file cannot be written.
    """
    detected: dict[int, int] = {}
    last_px: dict[int, FloatArray] = {}
    rows = []
    for frame, states in zip(sequence.frames, tracks, strict=True):
        for track in states:
            if track.detection is not None:
                box, count = frame.boxes_px[track.detection], detected.get(track.id, 0)
                if sequence.px_per_m and count:
                    box = _resized(box, last_px[track.id], max(_SIZE_GAIN, 1 / (count + 1)))
                last_px[track.id], detected[track.id] = box, count + 1
            elif track.id not in last_px:
                continue
            box, position = last_px[track.id], ",".join(f"{x:.3f}" for x in track.position_world_m)
            if sequence.px_per_m:
                foot_px = track.position_world_m[:2] * [sequence.px_per_m, -sequence.px_per_m]
                box, position = np.concatenate([box[:2] + foot_px - _foot_px(box[None])[0], box[2:]]), "-1,-1,-1"
            box_columns = ",".join(f"{pixels:.2f}" for pixels in box)
            rows.append(f"{frame.number},{track.id},{box_columns},{track.score:.4f},{position}\n")
    write_bytes(path, "".join(rows).encode())


def _resized(box_px: FloatArray, last_px: FloatArray, gain: float) -> FloatArray:
    """Return a box (4,) with a size between that of the last box and its own, by gain on a logarithmic scale."""
    size_px = last_px[2:] * (box_px[2:] / last_px[2:]) ** gain
    return np.concatenate([box_px[:2], size_px])
