"""Contents of a report, collected from a dataset, its maps, their evaluation and its tracks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from shlex import quote
from typing import Any

from appocc.bevmap import BEVMap, bev_folder, load_map
from appocc.errors import DataError
from appocc.evaluation.bev import Evaluation, EvaluationConfig, FrameScore, evaluate
from appocc.evaluation.pairs import check_maps_exist
from appocc.files import read_json
from appocc.files.questions import files_there
from appocc.nuscenes import Dataset, Sample, Scene
from tracking.pipeline import tracks_folder

TRUTHS = ("exact", "groundtruth")


@dataclass(frozen=True, eq=False)
class TrackScores:
    """Tracks of a scene and their scores.

    Attributes:
        scene: name of the scene.
        metrics: metrics of all, moving and parked vehicles by name; None if the scene has no scored tracks.
        reason: why there are no metrics; '' if there are.
    """

    scene: str
    metrics: dict[str, dict[str, Any]] | None
    reason: str = ""


@dataclass(frozen=True, eq=False)
class ReportContent:
    """Contents of a report.

    Attributes:
        dataset: dataset of the maps.
        scenes: scenes with key frames.
        source: source of the evaluated maps.
        against: source of the true maps; None if there are none.
        first: the first evaluated map.
        first_truth: the first true map; None if there are none.
        evaluation: comparison of the maps; None without true maps.
        tracks: tracks of each scene.
        commands: commands that make the same numbers.
    """

    dataset: Dataset
    scenes: tuple[Scene, ...]
    source: str
    against: str | None
    first: BEVMap
    first_truth: BEVMap | None
    evaluation: Evaluation | None
    tracks: tuple[TrackScores, ...]
    commands: tuple[str, ...]

    @property
    def samples(self) -> tuple[Sample, ...]:
        """The key frames of all scenes in order."""
        return tuple(sample for scene in self.scenes for sample in self.dataset.samples(scene))

    def worst(self, count: int) -> list[tuple[str, FrameScore]]:
        """Return the scene and score of the frames with the lowest mean IoU, the lowest first."""
        scenes = () if self.evaluation is None else self.evaluation.scenes
        scored = [(scene.name, frame) for scene in scenes for frame in scene.frames]
        known = [pair for pair in scored if pair[1].mean_iou == pair[1].mean_iou]
        return sorted(known, key=lambda pair: pair[1].mean_iou)[:count]


def collect(
    dataset: Dataset, source: str, against: str | None, scene: Scene | None, advance: Callable[[float], None]
) -> ReportContent:
    """Evaluate the maps of a source and collect all contents.

    Args:
        dataset: the dataset.
        source: source of the maps.
        against: source of the true maps; None takes the exact ones, else the ground truth, else none.
        scene: only this scene.
        advance: progress callback in samples.

    Raises:
        DataError: if there are no key frames, or a map is missing or damaged.
    """
    scenes = tuple(one for one in ([scene] if scene else dataset.scenes) if dataset.samples(one))
    samples = [sample for one in scenes for sample in dataset.samples(one)]
    if not samples:
        raise DataError(f"{dataset.root}: no key frames to report on")
    check_maps_exist(dataset.root, source, samples)
    truth = against or _truth(dataset, source, samples)
    evaluation = None
    if truth is not None:
        evaluation = evaluate(dataset, scenes, EvaluationConfig(source, truth), advance)
    first = load_map(dataset.root, source, samples[0].token)
    return ReportContent(
        dataset,
        scenes,
        source,
        truth,
        first,
        None if truth is None else load_map(dataset.root, truth, samples[0].token),
        evaluation,
        tuple(track_scores(dataset, source, one) for one in scenes),
        _commands(dataset, source, truth, first, scene),
    )


def _truth(dataset: Dataset, source: str, samples: Sequence[Sample]) -> str | None:
    """Return the source of true maps to compare with: the first that has a map of each sample."""
    for name in TRUTHS:
        wanted = [f"{sample.token}.npz" for sample in samples]
        if name != source and files_there(bev_folder(dataset.root, name), wanted).issuperset(wanted):
            return name
    return None


def track_scores(dataset: Dataset, source: str, scene: Scene) -> TrackScores:
    """Return the scores that `appocc track` wrote for the maps of a scene.

    Raises:
        DataError: if the file is damaged.
    """
    path = tracks_folder(dataset.root, source, scene.name) / "metrics.json"
    if not path.is_file():
        made = path.with_name("tracking.json").is_file()
        return TrackScores(scene.name, None, "tracked, but not annotated" if made else "not tracked")
    content = read_json(path)
    names = ("metrics", "metrics_moving", "metrics_parked")
    if not isinstance(content, dict) or not all(isinstance(content.get(name), dict) for name in names):
        raise DataError(f"{path}: expected scores of tracks ({', '.join(names)}), got none")
    return TrackScores(scene.name, {name: content[name] for name in names})


def _commands(
    dataset: Dataset, source: str, truth: str | None, first: BEVMap, scene: Scene | None
) -> tuple[str, ...]:
    """Return the commands that make maps, scores and tracks of a source."""
    root, folder = quote(str(dataset.root)), quote(str(bev_folder(dataset.root, source)))
    chosen = f" --scene {quote(scene.name)}" if scene else ""
    made = [] if first.is_truth else [f"appocc infer {root} --out {folder}{chosen}"]
    if source == "groundtruth" or truth == "groundtruth":
        made.append(f"appocc groundtruth {root}")
    if truth is not None:
        made.append(f"appocc eval bev {root} --bev {quote(source)} --against {truth}{chosen}")
    scenes = [scene] if scene else [one for one in dataset.scenes if dataset.samples(one)]
    made += [f"appocc track scene {root} --scene {quote(one.name)} --bev {quote(source)}" for one in scenes[:3]]
    return tuple(made)
