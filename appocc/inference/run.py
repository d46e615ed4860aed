"""Inference over many inputs: a map file for each, kept if it is up to date."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import NamedTuple, Protocol

from appocc.bevmap import BEVMap, picture_path
from appocc.checks import FloatArray
from appocc.errors import DataError
from appocc.files import path_of
from appocc.frame import Frame
from appocc.inference.inputs import InferenceInput
from appocc.inference.predictor import MAP_RULES, Prediction, Predictor
from appocc.nuscenes.detection_results import ResultBox, result_boxes, write_results
from appocc.provenance import Record, add_record, digest
from appocc.typing import PathLike

# Names of folders for true maps.
_TRUE_FOLDERS = ("exact", "groundtruth")


class InferenceResult(NamedTuple):
    """A predicted map before it is written.

    Attributes:
        frame: frame that it was predicted from.
        bev: the map.
        picture: path for a picture of the map; None without pictures.
    """

    frame: Frame
    bev: BEVMap
    picture: Path | None


class InferenceSummary(NamedTuple):
    """Counts of an inference run.

    Attributes:
        made: number of maps that were predicted.
        kept: number of existing maps that were up to date.
        missing: channel -> in how many frames the camera was missing, and the first reason.
        stale: reason -> how many existing maps were predicted again.
    """

    made: int
    kept: int
    missing: dict[str, tuple[int, str]]
    stale: dict[str, int]


class MapTracking(Protocol):
    """Completes the maps of a drive with what the maps before tell of their objects, such as velocities."""

    def reset(self) -> None:
        """Forget all maps: the next one is the first of a drive."""

    def __call__(self, bev: BEVMap, timestamp_us: int, world_from_ego: FloatArray) -> BEVMap:
        """Return the completed map of a time with ego pose (4, 4)."""


class InferenceRun:
    """Predict maps and write them to `out/TOKEN.npz`; maps of the same inputs are kept.

    Iterate over the run to execute it: it yields None for an input whose map is kept, else the result before its map
    is written. The caller writes the picture of a result to `result.picture` before it continues, so that a map
    always has its picture; an input without one is predicted again.
    """

    def __init__(
        self,
        inputs: Sequence[InferenceInput],
        predictor: Predictor,
        out: PathLike,
        detections: PathLike | None = None,
        pictures: bool = True,
        is_part: bool = False,
        tracking: MapTracking | None = None,
    ) -> None:
        """Prepare a run.

        Args:
            inputs: what to predict.
            predictor: network with its weights.
            out: folder of the maps.
            detections: file for the objects of all inputs as nuScenes' detection results, written at the end.
            pictures: whether maps have pictures; without, an existing map needs none to be kept.
            is_part: whether other processes write into `out` at the same time; `finish` then tidies up after all.
            tracking: completes the objects of the maps of a drive; None: each map has those of its own prediction.

        Raises:
            DataError: if `out` is a folder of ground truth, or inputs without poses cannot have detections.
        """
        self._inputs, self._predictor, self._out, self._pictures = inputs, predictor, path_of(out), pictures
        self._is_part, self._tracking = is_part, tracking
        objects = tracking is not None and predictor.model.parts.objects
        self._needs_past = predictor.has_memory or objects
        self._detections = None if detections is None else path_of(detections)
        if self._detections is not None and any(each.pose is None for each in inputs):
            raise DataError(f"{detections}: detections need ego poses: expected a dataset, got a folder of images")
        if self._out.resolve().name in _TRUE_FOLDERS:
            raise DataError(f"{out}: a folder of this name is for true maps; name another one")
        self._made = self._kept = 0
        self._missing: dict[str, tuple[int, str]] = {}
        self._stale: Counter[str] = Counter()

    def __len__(self) -> int:
        """Number of inputs."""
        return len(self._inputs)

    def __iter__(self) -> Iterator[InferenceResult | None]:
        """Predict the inputs in order.

        Raises:
            DataError: if an image has another size than its rig says, a frame has no working camera, `out` cannot be
                written or holds ground truth, or the weights predict no objects and detections are asked for.
        """
        record = Record(self._out)
        for _, drive in groupby(enumerate(self._inputs), key=lambda pair: pair[1].drive or pair[0]):
            yield from self._predict_drive([each for _, each in drive], record)
        if not self._is_part:
            self.finish()

    def finish(self) -> None:
        """Tidy the record of the inputs and write the detections; at the end of a run, or of all its parts.

        Raises:
            DataError: if a map is missing, or a file cannot be written.
        """
        Record(self._out).tidy()
        if self._detections is not None:
            write_results(self._detections, {each.token: self._boxes(each) for each in self._inputs})

    def add(self, part: InferenceSummary) -> None:
        """Add the counts of a part of this run, which another process has executed."""
        self._made += part.made
        self._kept += part.kept
        self._stale.update(part.stale)
        for channel, (times, reason) in part.missing.items():
            count, first = self._missing.get(channel, (0, reason))
            self._missing[channel] = (count + times, first)

    def _predict_drive(self, inputs: Sequence[InferenceInput], record: Record) -> Iterator[InferenceResult | None]:
        """Predict the frames of a drive; with memory or tracking, a map is made of all frames up to its own."""
        why_stale = partial(_why_stale, predictor=self._predictor)
        self._predictor.reset()
        if self._tracking is not None:
            self._tracking.reset()
        earlier = ""
        unread: list[InferenceInput] = []  # with kept maps, which memory and tracking do not have yet
        for each in inputs:
            path = self._out / f"{each.token}.npz"
            picture = picture_path(self._out, each.title) if self._pictures else None
            own = {**each.parts(), "appocc's rules": str(MAP_RULES)}
            parts = {**own, "earlier frames": earlier} if earlier else own
            if self._needs_past:
                earlier = digest([earlier, sorted(own.items())])
            reason = record.why_remake(path, picture or path, parts, why_stale)
            if reason is None:
                self._kept += 1
                unread.append(each)
                yield None
                continue
            self._stale.update([reason] if reason else [])
            for before in unread if self._needs_past else ():
                self._predict(before.read().frame)
            unread.clear()
            frame, missing = each.read()
            self._count_missing(missing.items())
            if missing and not frame.images:
                raise DataError(f"{each.token}: no image can be used: {'; '.join(dict.fromkeys(missing.values()))}")
            bev, seen = self._predict(frame)
            self._check_objects(bev)
            yield InferenceResult(frame, bev, picture)
            bev.save(path, {"seen": seen})
            add_record(self._out, each.token, parts)
            self._made += 1

    def _predict(self, frame: Frame) -> Prediction:
        bev, seen = self._predictor(frame)
        if self._tracking is not None:
            bev = self._tracking(bev, frame.timestamp_us, frame.world_from_ego)
        return Prediction(bev, seen)

    def _check_objects(self, bev: BEVMap) -> None:
        if self._detections is not None and bev.objects is None:
            name = self._predictor.weights.name
            raise DataError(
                f"{self._detections}: the weights '{name}' predict no objects to be written as detections"
            )

    def _boxes(self, each: InferenceInput) -> list[ResultBox]:
        """Return the boxes of an input from its written map, which may be a kept one."""
        bev = BEVMap.load(self._out / f"{each.token}.npz")
        self._check_objects(bev)
        if bev.known_objects is None or each.pose is None:
            return []
        return result_boxes(bev.known_objects, each.pose())

    def _count_missing(self, missing: Iterable[tuple[str, str]]) -> None:
        for channel, reason in missing:
            count, first = self._missing.get(channel, (0, reason))
            self._missing[channel] = (count + 1, first)

    @property
    def summary(self) -> InferenceSummary:
        """Counts so far."""
        return InferenceSummary(self._made, self._kept, dict(self._missing), dict(self._stale))


def _why_stale(path: Path, predictor: Predictor) -> str:
    """Return why an existing map is not from these weights and this model spec; '' if it is.

    Raises:
        DataError: if it is not a prediction: ground truth must not be replaced.
    """
    try:
        meta = BEVMap.load(path).meta
    except DataError:
        return "damaged"
    if meta.get("source", "predicted") != "predicted" or "sources" in meta:
        raise DataError(f"{path}: expected a predicted map or none, got a truth; name another folder")
    if meta.get("weights") != predictor.weights.as_meta():
        return "weights changed"
    return "" if meta.get("setting") == predictor.model.spec.name else "setting changed"
