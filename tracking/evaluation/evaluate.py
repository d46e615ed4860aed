"""Scores of anybody's tracker files against truth in the same format, or against the annotations of a dataset.

What is compared, beyond the definitions in `tracking.evaluation.clear_id_hota` and `tracking.evaluation.amota`:

- Categories other than the one asked for are left out, in truth and tracks alike. In KITTI's truth, the category that
  is easily taken for it (Van for Car, Person_sitting for Pedestrian) is ignored.
- With a range, objects beyond it are ignored, and so are unmatched tracks beyond it. It is measured from the ego (in
  KITTI: from the camera), which a nuScenes JSON alone does not know.
- Annotations of a dataset without LiDAR and RADAR points are ignored. Unless a range is given, that of nuScenes'
  benchmark holds: 40 m for pedestrians and two-wheelers, 50 m for all else.
- In KITTI, unmatched tracks of 25 pixels or less, or with more than half of their image box in a DontCare region of
  the truth, are not judged. Tracks without an image box are.
- In images, boxes are compared by their overlap.
- AMOTA needs a score with every track, and places in a frame that does not move: nuScenes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from appocc.boxes import is_vehicle
from appocc.checks import BoolArray, FloatArray, IntArray, check_distance
from appocc.errors import DataError
from tracking.evaluation.alignment import PairedFrame, Pairing, pair
from tracking.evaluation.amota import Amota, ScoredMoment, amota
from tracking.evaluation.clear_id_hota import (
    BY_OVERLAP,
    GATE_M,
    Compared,
    Metrics,
    Moment,
    evaluate,
    evaluate_compared,
)
from tracking.image_boxes import common_px, judged
from tracking.io.readers import DONT_CARE, Entries, Format

_NEAR = {"pedestrian", "motorcycle", "bicycle"}
_NEAR_M, _FAR_M = 40.0, 50.0
_ALIKE = {"car": "van", "pedestrian": "person_sitting"}


@dataclass(frozen=True)
class Question:
    """What is asked.

    Attributes:
        kind: category; `vehicle` stands for all vehicles but bicycles, None for everything.
        range_m: how far from the ego; None: no limit, in a dataset that of the benchmark.
        gate_m: distance below which a track can answer for an object; None: `GATE_M`.
    """

    kind: str | None = None
    range_m: float | None = None
    gate_m: float | None = None

    def __post_init__(self) -> None:
        """Check that distances can be true.

        Raises:
            ShapeError: if one is not positive and finite.
        """
        check_distance("--range", self.range_m)
        check_distance("--gate", self.gate_m)


@dataclass(frozen=True)
class Answer:
    """Scores.

    Attributes:
        metrics: of all tracks.
        amota: nuScenes' protocol; None where it does not apply.
        protocol: what was compared and how.
    """

    metrics: Metrics
    amota: Amota | None
    protocol: dict[str, Any]

    def as_json(self) -> dict[str, Any]:
        """Metrics and protocol; `at_best_MOTA` has nuScenes' figures at the threshold of the best MOTA."""
        a = self.amota
        own = {"AMOTA": a.AMOTA if a else None, "AMOTP": a.AMOTP if a else None}
        best = {"threshold": a.threshold, **a.best.as_json()} if a and a.best else None
        return {"metrics": {**self.metrics.as_json(), **own, "at_best_MOTA": best}, "protocol": self.protocol}


def score_files(truth: Path, tracks: Path, question: Question, version: str | None = None) -> Answer:
    """Score a file of tracks against a file of truth, or against a dataset.

    Raises:
        DataError: if a file is damaged, they do not fit each other, or the question does not fit them.
    """
    pairing = pair(truth, tracks, version)
    _check(truth, pairing, question)
    protocol: dict[str, Any] = {
        "format": pairing.format.value,
        "scenes": len({frame.scene for frame in pairing.frames}),
        "frames": len(pairing.frames),
        "samples_without_truth": pairing.without_truth,
        "kind": question.kind,
    }
    frames = [_of_kind(frame, question.kind) for frame in pairing.frames]
    if pairing.format is Format.mot:
        compared = _overlaps(frames)
        return Answer(evaluate_compared(compared, BY_OVERLAP), None, {**protocol, "gate_iou": 0.5})
    gate_m = question.gate_m or GATE_M
    protocol |= {"range_m": _range_told(pairing, question), "gate_m": gate_m, "hota_zero_m": gate_m}
    moments = _moments(frames, pairing, question)
    metrics = evaluate([one.moment for one in moments], gate_m)
    return Answer(metrics, amota(moments, gate_m) if _has_scores(frames, pairing) else None, protocol)


def _check(truth: Path, pairing: Pairing, question: Question) -> None:
    """Whether the question can be answered.

    Raises:
        DataError: if not.
    """
    if pairing.format is Format.mot:
        asked = {"kind": question.kind, "range": question.range_m, "gate": question.gate_m}
        for name, value in asked.items():
            if value is not None:
                raise DataError(f"{truth}: MOTChallenge text has image boxes alone; --{name} cannot be answered")
    if question.range_m is not None and any(frame.ego_xy_m is None for frame in pairing.frames):
        raise DataError(f"{truth}: a JSON file does not say where the ego is; for --range give the dataset's root")
    kinds = {kind for frame in pairing.frames for kind in frame.truth.kind} - {DONT_CARE}
    if not any(_is(kind, question.kind) for kind in kinds):
        known = ", ".join(sorted(kinds)) or "none"
        raise DataError(f"{truth}: expected objects of kind '{question.kind or 'any'}', got {known}")


def _range_told(pairing: Pairing, question: Question) -> float | dict[str, float] | None:
    """The range in metres; by category where it differs, None for no limit."""
    if question.range_m is not None or not pairing.annotated:
        return question.range_m
    if question.kind is None or question.kind.lower() == "vehicle":
        return {**dict.fromkeys(sorted(_NEAR), _NEAR_M), "others": _FAR_M}
    return _class_range_m(question.kind)


def _class_range_m(kind: str) -> float:
    return _NEAR_M if kind.lower() in _NEAR else _FAR_M


def _has_scores(frames: Sequence[PairedFrame], pairing: Pairing) -> bool:
    scores = np.concatenate([frame.tracks.score for frame in frames])
    return pairing.format is Format.nuscenes and len(scores) > 0 and bool(np.isfinite(scores).all())


# Who is asked for -------------------------------------------------------------------------------------------------


def _is(kind: str, wanted: str | None) -> bool:
    """Whether a category is one that was asked for; large and small letters are the same."""
    kind = kind.lower()
    if wanted is None or wanted.lower() == kind:
        return True
    return wanted.lower() == "vehicle" and is_vehicle(kind)


def _of_kind(frame: PairedFrame, wanted: str | None) -> PairedFrame:
    """Only what was asked for, and in truth what is easily taken for it and regions, neither of which is demanded."""
    alike = _ALIKE.get((wanted or "").lower())
    asked = np.array([_is(kind, wanted) and kind != DONT_CARE for kind in frame.truth.kind], dtype=np.bool_)
    aside = np.array([kind == DONT_CARE or kind.lower() == alike for kind in frame.truth.kind], dtype=np.bool_)
    truth = frame.truth
    truth = Entries(truth.ids, truth.kind, truth.xy_m, truth.box_px, truth.score, truth.demanded & asked)
    tracks = frame.tracks.select(np.array([_is(kind, wanted) for kind in frame.tracks.kind], dtype=np.bool_))
    return PairedFrame(truth.select(asked | aside), tracks, frame.scene, frame.time_us, frame.ego_xy_m)


def _numbers(frames: Sequence[PairedFrame]) -> tuple[list[IntArray], list[IntArray]]:
    """Whole numbers for the ids of truth and tracks, different in different scenes."""
    result: tuple[list[IntArray], list[IntArray]] = ([], [])
    for numbers, entries in zip(result, zip(*((f.truth, f.tracks) for f in frames), strict=True), strict=True):
        known: dict[tuple[str, str], int] = {}
        for frame, part in zip(frames, entries, strict=True):
            names = [known.setdefault((frame.scene, name), len(known)) for name in part.ids]
            numbers.append(np.array(names, dtype=np.int64))
    return result


# On the ground ----------------------------------------------------------------------------------------------------


def _moments(frames: Sequence[PairedFrame], pairing: Pairing, question: Question) -> list[ScoredMoment]:
    moments = []
    default = pairing.annotated and question.range_m is None
    for frame, truth_ids, track_ids in zip(frames, *_numbers(frames), strict=True):
        regions = np.array([kind == DONT_CARE for kind in frame.truth.kind], dtype=np.bool_)
        truth, tracks = frame.truth.select(~regions), frame.tracks
        near = [_within(part, frame.ego_xy_m, question.range_m, default) for part in (truth, tracks)]
        boxless = ~(tracks.box_px[:, 2:] > tracks.box_px[:, :2]).all(axis=1)
        counted = near[1] & (boxless | judged(tracks.box_px, frame.truth.box_px[regions]))
        moment = Moment(truth_ids[~regions], truth.xy_m, truth.demanded & near[0], track_ids, tracks.xy_m, counted)
        moments.append(ScoredMoment(frame.time_us, moment, np.nan_to_num(tracks.score)))
    return moments


def _within(entries: Entries, ego_xy_m: FloatArray | None, range_m: float | None, by_class: bool) -> BoolArray:
    """(N,) who is nearer than the range, or than that of its class."""
    if ego_xy_m is None or not (range_m or by_class):
        return np.ones(len(entries), dtype=np.bool_)
    limits = np.array([range_m or _class_range_m(kind) for kind in entries.kind])
    return np.asarray(np.hypot(*(entries.xy_m - ego_xy_m).T) < limits)


# In images --------------------------------------------------------------------------------------------------------


def _overlaps(frames: Sequence[PairedFrame]) -> list[Compared]:
    """Frames by 1 - IoU."""
    compared = []
    for frame, truth_ids, track_ids in zip(frames, *_numbers(frames), strict=True):
        one, other = frame.truth.box_px, frame.tracks.box_px
        common = common_px(one, other)
        areas = [np.prod(boxes[:, 2:] - boxes[:, :2], axis=1) for boxes in (one, other)]
        union = areas[0][:, None] + areas[1] - common
        distance = 1 - common / np.maximum(union, np.finfo(np.float64).tiny)
        every = np.ones(len(track_ids), dtype=np.bool_)
        compared.append(Compared(truth_ids, frame.truth.demanded, track_ids, every, distance))
    return compared
