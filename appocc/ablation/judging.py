"""A trained row on the test set: its maps, then the figures of `appocc eval bev` over them."""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from appocc.bevmap import BEVMap
from appocc.evaluation.bev import Question, evaluate
from appocc.evaluation.pairs import check_there
from appocc.frame import Frame
from appocc.inference.inputs import dataset_inputs
from appocc.inference.predictor import Prediction, stack_images
from appocc.models.model_spec import ModelSpec
from appocc.models.registry import Colouring
from appocc.nuscenes.dataset import Dataset
from appocc.nuscenes.records import Scene


class Maker(Protocol):
    """Answers frames with maps."""

    def __call__(self, frame: Frame) -> Prediction:
        """The map of a frame."""
        ...


class ColouringMaker:
    """Maps of a colouring that learns nothing: colours where a camera sees the cell, nothing of occupancy."""

    def __init__(self, colouring: Colouring, spec: ModelSpec) -> None:
        """Take the colouring and what it is to see."""
        self._colouring, self._setting = colouring, spec

    def __call__(self, frame: Frame) -> Prediction:
        """The map of a frame.

        Raises:
            DataError: if it has no image that the setting uses.
        """
        spec, grid = self._setting, self._setting.grid
        pictures, rig = stack_images(frame, spec)
        rgb, known = (each.numpy() for each in self._colouring(pictures.float() / 255, rig, grid))
        nothing = np.zeros((3, *grid.shape))
        colours = (rgb * 255).round().astype(np.uint8)
        bev = BEVMap(grid, nothing.astype(np.float32), nothing.astype(np.bool_), colours, known)
        return Prediction(bev, known)


@dataclass(frozen=True)
class JudgingSet:
    """What rows are judged on.

    Attributes:
        dataset: with maps of source `against`.
        scenes: of it.
        against: source of the truth.
    """

    dataset: Dataset
    scenes: Sequence[Scene]
    against: str

    @cached_property
    def tokens(self) -> list[str]:
        """Of all samples."""
        return [sample.token for scene in self.scenes for sample in self.dataset.samples(scene)]

    def as_json(self) -> dict[str, Any]:
        """What it is, for the tables."""
        told = {"root": str(self.dataset.root), "against": self.against}
        return {**told, "scenes": len(self.scenes), "samples": len(self.tokens)}

    def check(self) -> None:
        """Check before hours of training that there is something to judge on.

        Raises:
            DataError: if there are no samples, or one has no true map.
        """
        dataset_inputs(self.dataset, self.scenes)
        samples = [sample for scene in self.scenes for sample in self.dataset.samples(scene)]
        check_there(self.dataset.root, self.against, samples)

    def key(self, weights: bytes) -> str:
        """Tells whether figures are of these weights on this test set."""
        told = {"weights": hashlib.sha256(weights).hexdigest(), "against": self.against, "tokens": self.tokens}
        return hashlib.sha256(json.dumps(told).encode()).hexdigest()


def judge(
    maker: Maker, test: JudgingSet, ahead: bool, maps: Path, advance: Callable[[float], None]
) -> dict[str, Any]:
    """The figures of `appocc eval bev`; `maps` holds the maps as long as it takes, those that are there are kept.

    `advance` is called with the share of the frames that is done.

    Raises:
        AppoccError: if a picture or a true map is missing, damaged or on another grid.
    """
    inputs = dataset_inputs(test.dataset, test.scenes)
    for number, each in enumerate(inputs):
        path = maps / f"{each.token}.npz"
        if not path.is_file():
            bev, seen = maker(each.read().frame)
            bev.save(path, {"seen": seen})
        advance((number + 1) / len(inputs))
    # A slash makes it a folder, not the name of a source.
    question = Question(f"{maps}/", test.against, ahead)
    figures = evaluate(test.dataset, test.scenes, question, lambda done: None).as_json()
    shutil.rmtree(maps)
    return {name: plain(value) for name, value in figures.items() if name != "source"}


def plain(value: Any) -> Any:
    """JSON values; what is not finite becomes null."""
    if isinstance(value, dict):
        return {str(name): plain(item) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value
