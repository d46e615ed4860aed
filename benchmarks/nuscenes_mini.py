"""Tracking of cars in nuScenes scenes by nuScenes' rules, with a plain Kalman filter and published trackers.

    OMP_NUM_THREADS=1 python -m benchmarks.nuscenes_mini FILE [--detector centerpoint] [--json]

FILE contains scenes in the format of `tracking.io.nuscenes_detections.read_scenes`. Ground truth: cars within 50 m
with LiDAR points. AMOTA is over 40 recalls (`tracking.evaluation.amota`); the other figures are at the threshold of
the best MOTA, on the same interpolated tracks. The tracker gets the boxes of all classes, and its tracks of cars are
evaluated; the plain filter of `benchmarks.kitti` gets only cars, and deletes tracks after three key frames (1.5 s)
without a match.

The figures of other trackers were measured on scene-0103 only, with CenterPoint's boxes and the same rules.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from appocc.checks import FloatArray
from appocc.errors import AppoccError, DataError
from benchmarks.kitti import PlainFilter
from tracking.detections import Detections, probability_from_log_odds
from tracking.evaluation.amota import ScoredFrame, evaluate_amota, filter_by_score, prepare_frames
from tracking.evaluation.clear_id_hota import evaluate
from tracking.evaluation.frames import EvaluationFrame
from tracking.io.nuscenes_detections import RANGE_M, SceneDetections, read_scene_file
from tracking.pipeline import OnlineTracker
from tracking.tracker import Tracker
from tracking.tracks import Track

KIND, MOST_UNSEEN = "car", 3
FIGURES = ("AMOTA", "AMOTP", "MOTA", "IDF1", "HOTA", "IDS", "FRAG", "FP", "FN")
MEASURED = ("scene-0103", "centerpoint")
OTHERS: dict[str, dict[str, float]] = {
    "AB3DMOT": {"AMOTA": 0.844, "MOTA": 0.768, "IDF1": 0.869, "IDS": 2, "HOTA": 0.696},
    "places alone, gate 2 m": {"AMOTA": 0.809, "MOTA": 0.723, "IDS": 48},
    "places alone, gate 4 m": {"AMOTA": 0.788, "IDS": 22},
    "places alone, no ego motion": {"AMOTA": 0.508, "IDS": 86},
}


class _PlainFilter(PlainFilter):
    """The plain filter at two key frames a second."""

    def update(self, detections: Detections, timestamp_us: int, world_from_ego: FloatArray) -> tuple[Track, ...]:
        """Return the tracks with a matched detection; their scores are probabilities."""
        tracks = super().update(detections, timestamp_us, world_from_ego)
        self._alive = [point for point in self._alive if point.unseen <= MOST_UNSEEN]
        return tuple(replace(track, score=float(probability_from_log_odds(track.score))) for track in tracks)


@dataclass(frozen=True)
class _Part:
    """A tracker's tracks of one scene, with the truth; ids start at `first_id`."""

    moments: list[ScoredFrame]
    next_id: int


def _track(tracker: OnlineTracker, scene: SceneDetections, kind: str, alone: bool, first_id: int) -> _Part:
    """Track a scene with a new tracker, which gets the boxes of all kinds, or those of one alone."""
    moments, next_id = [], first_id
    rows = zip(scene.detections, scene.timestamps_us.tolist(), scene.world_from_ego, scene.truth, strict=True)
    for seen, time_us, pose, truth in rows:
        given = seen.select(np.array([own == kind for own in seen.kind], np.bool_)) if alone else seen
        tracks = [track for track in tracker.update(given, time_us, pose) if track.kind == kind]
        chosen = np.array([own == kind for own in truth.kind], dtype=np.bool_)
        ids = np.array([first_id + track.id for track in tracks], dtype=np.int64)
        objects, places = (
            truth.centre_m[chosen, :2],
            np.array([t.position_world_m[:2] for t in tracks]).reshape(-1, 2),
        )
        near = [np.hypot(*(xy - pose[:2, 3]).T) < RANGE_M for xy in (objects, places)]
        moment = EvaluationFrame(
            first_id + truth.ids[chosen], objects, near[0] & (truth.points[chosen] > 0), ids, places, near[1]
        )
        moments.append(ScoredFrame(time_us, moment, np.array([track.score for track in tracks])))
        next_id = max([next_id, *(ids + 1).tolist(), *(first_id + truth.ids + 1).tolist()])
    return _Part(moments, next_id)


def measure(scenes: Sequence[SceneDetections], plain: bool, kind: str = KIND) -> dict[str, float]:
    """Return the figures of the tracker, or of the plain filter, for a kind over all scenes.

    Raises:
        DataError: if no annotated object is found.
    """
    moments: list[ScoredFrame] = []
    first_id = 0
    for scene in scenes:
        part = _track(_PlainFilter() if plain else Tracker(), scene, kind, plain, first_id)
        moments, first_id = moments + part.moments, part.next_id
    result = evaluate_amota(moments)
    if result.best is None:
        raise DataError(f"expected objects of kind {kind} to be found, got none")
    best = evaluate(filter_by_score(prepare_frames(moments), result.threshold))
    own = {name: float(getattr(best, name)) for name in FIGURES if not name.startswith("AMOT")}
    return {"AMOTA": result.AMOTA, "AMOTP": result.AMOTP, **own}


def table(rows: dict[str, dict[str, float]]) -> Table:
    """Return the figures as a table; shares in percent."""
    made = Table("tracker", *FIGURES)
    for name, figures in rows.items():
        cells = []
        for figure in FIGURES:
            value, share = figures.get(figure, float("nan")), figure in ("AMOTA", "MOTA", "IDF1", "HOTA")
            digits = 1 if share else 2 if figure == "AMOTP" else 0
            cells.append("-" if value != value else f"{100 * value if share else value:.{digits}f}")
        made.add_row(name, *cells)
    return made


def main(arguments: Sequence[str] | None = None) -> None:
    """Parse arguments, measure, print a table or JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file", type=Path)
    parser.add_argument("--detector", default="centerpoint", help="name of the detector (centerpoint)")
    parser.add_argument("--json", action="store_true", help="print JSON; shares are 0..1")
    options = parser.parse_args(arguments)
    try:
        scenes = read_scene_file(options.file, options.detector)
        rows = {"appocc": measure(scenes, False), "plain filter": measure(scenes, True)}
    except AppoccError as error:
        parser.exit(error.exit_code, f"error: {error}\n")
    names = [scene.name for scene in scenes]
    if (*names, options.detector) == MEASURED:
        rows |= {f"{name} (measured before)": figures for name, figures in OTHERS.items()}
    if options.json:
        about: dict[str, Any] = {
            "file": str(options.file),
            "detector": options.detector,
            "scenes": names,
            "kind": KIND,
        }
        print(json.dumps({**about, "rows": rows}, indent=2))
    else:
        Console(width=140).print(table(rows))


if __name__ == "__main__":
    main()
