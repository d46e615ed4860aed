"""Inference over many inputs: a map file for each, kept if it is up to date."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

from appocc.bevmap import BEVMap, is_truth
from appocc.errors import DataError
from appocc.frame import Frame
from appocc.inference.inputs import InferenceInput
from appocc.inference.predictor import Predictor
from appocc.provenance import Record, add_record
from appocc.typing import PathLike

PICTURES = "pictures"


class InferenceResult(NamedTuple):
    """A predicted map before it is written.

    Attributes:
        frame: frame that it was predicted from.
        bev: the map.
        picture: path for a picture of the map.
    """

    frame: Frame
    bev: BEVMap
    picture: Path


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


class InferenceRun:
    """Predict maps and write them to `out/TOKEN.npz`; maps of the same inputs are kept.

    Iterate over the run to execute it: it yields None for an input whose map is kept, else the result before its map
    is written. The caller writes the picture of a result to `result.picture` before it continues, so that a map
    always has its picture; an input without one is predicted again.
    """

    def __init__(self, inputs: Sequence[InferenceInput], predictor: Predictor, out: PathLike) -> None:
        """Prepare a run.

        Raises:
            DataError: if `out` is a folder of ground truth.
        """
        self._inputs, self._predictor, self._out = inputs, predictor, Path(out)
        if is_truth(str(self._out.resolve())):
            raise DataError(f"{out}: maps in a folder of this name count as the truth; name another one")
        self._made = self._kept = 0
        self._missing: dict[str, tuple[int, str]] = {}
        self._stale: Counter[str] = Counter()

    def __len__(self) -> int:
        """Number of inputs."""
        return len(self._inputs)

    def __iter__(self) -> Iterator[InferenceResult | None]:
        """Predict the inputs in order.

        Raises:
            DataError: if an image has another size than its rig says, a frame has no working camera, or `out` cannot
                be written or holds ground truth.
        """
        record = Record(self._out)
        why_stale = partial(_why_stale, predictor=self._predictor)
        for each in self._inputs:
            path, picture = self._out / f"{each.token}.npz", self._out / PICTURES / f"{each.title}.png"
            parts = each.parts()
            reason = record.why_remake(path, picture, parts, why_stale)
            if reason is None:
                self._kept += 1
                yield None
                continue
            self._stale.update([reason] if reason else [])
            frame, missing = each.read()
            self._count_missing(missing.items())
            bev, seen = self._predictor(frame)
            yield InferenceResult(frame, bev, picture)
            bev.save(path, {"seen": seen})
            add_record(self._out, each.token, parts)
            self._made += 1
        record.tidy()

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
