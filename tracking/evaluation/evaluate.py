"""Scores of track files, or folders of them, against ground truth in the same format or a dataset's annotations.

Rules in addition to the definitions in `tracking.evaluation.clear_id_hota` and `tracking.evaluation.amota`:

- Only the requested category is evaluated. In KITTI's ground truth, its neighbouring category (Van for Car,
  Person and Person_sitting for Pedestrian) is ignored.
- With a range, objects beyond it are ignored, and so are unmatched tracks beyond it. It is measured from the ego (in
  KITTI: from the camera), whose position a nuScenes JSON alone does not contain.
- Annotations of a dataset without LiDAR and RADAR points are ignored. The default range is that of nuScenes'
  benchmark: 40 m for pedestrians and two-wheelers, 50 m for all others.
- In KITTI, unmatched tracks up to 25 pixels high, or with more than half of their image box in a DontCare region, are
  not penalised. Tracks without an image box are.
- In images, boxes are compared by their overlap.
- AMOTA needs a score for every track and positions in a static frame: nuScenes only.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from appocc.boxes import is_vehicle
from appocc.checks import BoolArray, FloatArray, IntArray, check_distance
from appocc.errors import DataError, ShapeError
from tracking.evaluation.alignment import AlignedFiles, AlignedFrame, align_files
from tracking.evaluation.amota import AmotaResult, ScoredFrame, evaluate_amota
from tracking.evaluation.clear_id_hota import Metrics, evaluate, evaluate_distances
from tracking.evaluation.frames import GATE_M, IOU_RULE, DistanceFrame, EvaluationFrame
from tracking.image_boxes import intersection_px2, kitti_penalised
from tracking.io.readers import DONT_CARE, FrameEntries, TrackFormat

_SHORT_RANGE = {"pedestrian", "motorcycle", "bicycle"}
_NEAR_M, _FAR_M = 40.0, 50.0
_NEIGHBOURING = {"car": ("van",), "pedestrian": ("person", "person_sitting")}


@dataclass(frozen=True)
class EvaluationOptions:
    """Options of an evaluation.

    Attributes:
        kind: category; `vehicle` means all vehicles except bicycles, None all categories.
        range_m: maximum distance from the ego; None for no limit, or the benchmark's in a dataset.
        gate_m: distance below which a track can match an object; None for `GATE_M`.
        min_score: minimum score of the rows of the tracks; None for all.
    """

    kind: str | None = None
    range_m: float | None = None
    gate_m: float | None = None
    min_score: float | None = None

    def __post_init__(self) -> None:
        """Check the distances and the score.

        Raises:
            ShapeError: if a distance is not positive and finite, or the score is not finite.
        """
        check_distance("--range", self.range_m)
        check_distance("--gate", self.gate_m)
        if self.min_score is not None and not np.isfinite(self.min_score):
            raise ShapeError(f"--min-score: expected a finite number, got {self.min_score:g}")


@dataclass(frozen=True)
class EvaluationReport:
    """Scores of a track file.

    Attributes:
        metrics: metrics of all tracks.
        amota: result of nuScenes' protocol; None if it does not apply.
        protocol: format, numbers of frames, and options of the evaluation.
    """

    metrics: Metrics
    amota: AmotaResult | None
    protocol: dict[str, Any]

    def as_json(self) -> dict[str, Any]:
        """Return metrics and protocol; `at_best_MOTA` are nuScenes' metrics at the threshold of the best MOTA."""
        a = self.amota
        own = {"AMOTA": a.AMOTA if a else None, "AMOTP": a.AMOTP if a else None}
        best = {"threshold": a.threshold, **a.best.as_json()} if a and a.best else None
        return {"metrics": {**self.metrics.as_json(), **own, "at_best_MOTA": best}, "protocol": self.protocol}


def evaluate_files(
    truth: Path, tracks: Path, options: EvaluationOptions, version: str | None = None
) -> EvaluationReport:
    """Evaluate a file of tracks against a file of ground truth or a dataset; folders are pooled, see `align_files`.

    Raises:
        DataError: if a file is damaged, the files are inconsistent, or the options do not apply to them.
    """
    aligned = align_files(truth, tracks, version)
    _check(truth, aligned, options)
    protocol: dict[str, Any] = {
        "format": aligned.format.value,
        "scenes": len({frame.scene for frame in aligned.frames}),
        "frames": len(aligned.frames),
        "samples_without_truth": aligned.without_truth,
        "kind": options.kind,
        "min_score": options.min_score,
    }
    frames = [_select(frame, options) for frame in aligned.frames]
    if aligned.format is TrackFormat.mot:
        metrics = evaluate_distances(_distance_frames(frames), IOU_RULE)
        return EvaluationReport(metrics, None, {**protocol, "gate_iou": 0.5})
    gate_m = options.gate_m or GATE_M
    protocol |= {"range_m": _describe_range(aligned, options), "gate_m": gate_m, "hota_zero_m": gate_m}
    scored = _scored_frames(frames, aligned, options)
    metrics = evaluate([one.frame for one in scored], gate_m)
    amota = evaluate_amota(scored, gate_m) if _has_scores(frames, aligned) else None
    return EvaluationReport(metrics, amota, protocol)


def _check(truth: Path, aligned: AlignedFiles, options: EvaluationOptions) -> None:
    """Check that the options apply to the files.

    Raises:
        DataError: if they do not.
    """
    if aligned.format is TrackFormat.mot:
        asked = {"kind": options.kind, "range": options.range_m, "gate": options.gate_m}
        for name, value in asked.items():
            if value is not None:
                raise DataError(f"{truth}: MOTChallenge text has image boxes alone; --{name} cannot be answered")
    if options.range_m is not None and any(frame.ego_xy_m is None for frame in aligned.frames):
        raise DataError(f"{truth}: a JSON file does not say where the ego is; for --range give the dataset's root")
    kinds = {kind for frame in aligned.frames for kind in frame.truth.kind} - {DONT_CARE}
    if not any(_is(kind, options.kind) for kind in kinds):
        known = ", ".join(sorted(kinds)) or "none"
        raise DataError(f"{truth}: expected objects of kind '{options.kind or 'any'}', got {known}")


def _describe_range(aligned: AlignedFiles, options: EvaluationOptions) -> float | dict[str, float] | None:
    """Return the range in metres: by category if it differs, None for no limit."""
    if options.range_m is not None or not aligned.annotated:
        return options.range_m
    if options.kind is None or options.kind.lower() == "vehicle":
        return {**dict.fromkeys(sorted(_SHORT_RANGE), _NEAR_M), "others": _FAR_M}
    return _class_range_m(options.kind)


def _class_range_m(kind: str) -> float:
    return _NEAR_M if kind.lower() in _SHORT_RANGE else _FAR_M


def _has_scores(frames: Sequence[AlignedFrame], aligned: AlignedFiles) -> bool:
    scores = np.concatenate([frame.tracks.score for frame in frames])
    return aligned.format is TrackFormat.nuscenes and len(scores) > 0 and bool(np.isfinite(scores).all())


# Categories -------------------------------------------------------------------------------------------------------


def _is(kind: str, wanted: str | None) -> bool:
    """Return whether a category is the wanted one, ignoring case."""
    kind = kind.lower()
    if wanted is None or wanted.lower() == kind:
        return True
    return wanted.lower() == "vehicle" and is_vehicle(kind)


def _select(frame: AlignedFrame, options: EvaluationOptions) -> AlignedFrame:
    """Select a category and a minimum score.

    Neighbouring categories and DontCare regions of the ground truth stay, as not required.
    """
    wanted = options.kind
    similar = _NEIGHBOURING.get((wanted or "").lower(), ())
    selected = np.array([_is(kind, wanted) and kind != DONT_CARE for kind in frame.truth.kind], dtype=np.bool_)
    ignored = np.array([kind == DONT_CARE or kind.lower() in similar for kind in frame.truth.kind], dtype=np.bool_)
    truth = frame.truth
    truth = FrameEntries(truth.ids, truth.kind, truth.xy_m, truth.box_px, truth.score, truth.required & selected)
    kept = np.array([_is(kind, wanted) for kind in frame.tracks.kind], dtype=np.bool_)
    if options.min_score is not None:
        kept &= frame.tracks.score >= options.min_score
    tracks = frame.tracks.select(kept)
    return AlignedFrame(truth.select(selected | ignored), tracks, frame.scene, frame.time_us, frame.ego_xy_m)


def _integer_ids(frames: Sequence[AlignedFrame]) -> tuple[list[IntArray], list[IntArray]]:
    """Return integers for the ids of ground truth and tracks, unique across scenes."""
    result: tuple[list[IntArray], list[IntArray]] = ([], [])
    for numbers, entries in zip(result, zip(*((f.truth, f.tracks) for f in frames), strict=True), strict=True):
        known: dict[tuple[str, str], int] = {}
        for frame, part in zip(frames, entries, strict=True):
            names = [known.setdefault((frame.scene, name), len(known)) for name in part.ids]
            numbers.append(np.array(names, dtype=np.int64))
    return result


# On the ground ----------------------------------------------------------------------------------------------------


def _scored_frames(
    frames: Sequence[AlignedFrame], aligned: AlignedFiles, options: EvaluationOptions
) -> list[ScoredFrame]:
    scored = []
    default = aligned.annotated and options.range_m is None
    for frame, truth_ids, track_ids in zip(frames, *_integer_ids(frames), strict=True):
        regions = np.array([kind == DONT_CARE for kind in frame.truth.kind], dtype=np.bool_)
        truth, tracks = frame.truth.select(~regions), frame.tracks
        inside = [_within(part, frame.ego_xy_m, options.range_m, default) for part in (truth, tracks)]
        boxless = ~(tracks.box_px[:, 2:] > tracks.box_px[:, :2]).all(axis=1)
        penalised = inside[1] & (boxless | kitti_penalised(tracks.box_px, frame.truth.box_px[regions]))
        both = EvaluationFrame(
            truth_ids=truth_ids[~regions],
            truth_xy_m=truth.xy_m,
            required=truth.required & inside[0],
            track_ids=track_ids,
            track_xy_m=tracks.xy_m,
            penalised=penalised,
        )
        scored.append(ScoredFrame(frame.time_us, both, np.nan_to_num(tracks.score)))
    return scored


def _within(entries: FrameEntries, ego_xy_m: FloatArray | None, range_m: float | None, by_class: bool) -> BoolArray:
    """(N,) whether entries are within the range, or that of their class."""
    if ego_xy_m is None or not (range_m or by_class):
        return np.ones(len(entries), dtype=np.bool_)
    limits = np.array([range_m or _class_range_m(kind) for kind in entries.kind])
    return np.asarray(np.hypot(*(entries.xy_m - ego_xy_m).T) < limits)


# In images --------------------------------------------------------------------------------------------------------


def _distance_frames(frames: Sequence[AlignedFrame]) -> list[DistanceFrame]:
    """Return frames with distances 1 - IoU."""
    result = []
    for frame, truth_ids, track_ids in zip(frames, *_integer_ids(frames), strict=True):
        one, other = frame.truth.box_px, frame.tracks.box_px
        common = intersection_px2(one, other)
        areas = [np.prod(boxes[:, 2:] - boxes[:, :2], axis=1) for boxes in (one, other)]
        union = areas[0][:, None] + areas[1] - common
        distance = 1 - common / np.maximum(union, np.finfo(np.float64).tiny)
        every = np.ones(len(track_ids), dtype=np.bool_)
        result.append(DistanceFrame(truth_ids, frame.truth.required, track_ids, every, distance))
    return result
