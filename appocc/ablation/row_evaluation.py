"""Evaluation of a row on the test set: predict its maps, then compute the metrics of `appocc eval bev`."""

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
from appocc.evaluation.bev import EvaluationConfig, evaluate
from appocc.evaluation.pairs import check_maps_exist
from appocc.frame import Frame
from appocc.inference.inputs import dataset_inputs
from appocc.inference.predictor import Prediction, stack_images
from appocc.models.model_spec import ModelSpec
from appocc.models.registry import Colouring
from appocc.nuscenes.dataset import Dataset
from appocc.nuscenes.records import Scene


class MapPredictor(Protocol):
    """Predicts the BEV map of a frame."""

    def __call__(self, frame: Frame) -> Prediction:
        """Return the map of a frame."""
        ...


class ColouringPredictor:
    """Maps of a colouring method without learning: appearance of the visible cells, unknown occupancy."""

    def __init__(self, colouring: Colouring, spec: ModelSpec) -> None:
        """Set the colouring method and its model spec."""
        self._colouring, self._spec = colouring, spec

    def __call__(self, frame: Frame) -> Prediction:
        """Return the map of a frame.

        Raises:
            DataError: if the frame has no image of a camera of the setting.
        """
        spec, grid = self._spec, self._spec.grid
        pictures, rig = stack_images(frame, spec)
        rgb, known = (each.numpy() for each in self._colouring(pictures.float() / 255, rig, grid))
        empty = np.zeros((3, *grid.shape))
        colours = (rgb * 255).round().astype(np.uint8)
        bev = BEVMap(grid, empty.astype(np.float32), empty.astype(np.bool_), colours, known)
        return Prediction(bev, known)


@dataclass(frozen=True)
class EvaluationSet:
    """Test scenes of a study.

    Attributes:
        dataset: dataset with maps of source `against`.
        scenes: test scenes of the dataset.
        against: source of the true maps.
    """

    dataset: Dataset
    scenes: Sequence[Scene]
    against: str

    @cached_property
    def tokens(self) -> list[str]:
        """Tokens of all samples."""
        return [sample.token for scene in self.scenes for sample in self.dataset.samples(scene)]

    def as_json(self) -> dict[str, Any]:
        """Return the description of the test set for the results."""
        source = {"root": str(self.dataset.root), "against": self.against}
        return {**source, "scenes": len(self.scenes), "samples": len(self.tokens)}

    def check(self) -> None:
        """Check the test set before hours of training.

        Raises:
            DataError: if there are no samples, or a sample has no true map.
        """
        dataset_inputs(self.dataset, self.scenes)
        samples = [sample for scene in self.scenes for sample in self.dataset.samples(scene)]
        check_maps_exist(self.dataset.root, self.against, samples)

    def key(self, weights: bytes) -> str:
        """Return a key of the results of these weights on this test set."""
        inputs = {"weights": hashlib.sha256(weights).hexdigest(), "against": self.against, "tokens": self.tokens}
        return hashlib.sha256(json.dumps(inputs).encode()).hexdigest()


def evaluate_row(
    predictor: MapPredictor, test: EvaluationSet, ahead: bool, maps: Path, advance: Callable[[float], None]
) -> dict[str, Any]:
    """Predict all maps and return the metrics of `appocc eval bev`.

    Args:
        predictor: predicts the maps.
        test: test set.
        ahead: whether only cells with x >= 0 count.
        maps: temporary folder of the predicted maps; existing maps of an interrupted run are reused.
        advance: progress callback with the finished share of the frames.

    Raises:
        AppoccError: if an image or a true map is missing, damaged or on another grid.
    """
    inputs = dataset_inputs(test.dataset, test.scenes)
    for number, each in enumerate(inputs):
        path = maps / f"{each.token}.npz"
        if not path.is_file():
            bev, seen = predictor(each.read().frame)
            bev.save(path, {"seen": seen})
        advance((number + 1) / len(inputs))
    # The trailing slash marks a folder instead of the name of a source.
    question = EvaluationConfig(f"{maps}/", test.against, ahead)
    figures = evaluate(test.dataset, test.scenes, question, lambda done: None).as_json()
    shutil.rmtree(maps)
    return {name: json_value(value) for name, value in figures.items() if name != "source"}


def json_value(value: Any) -> Any:
    """Return a JSON value; non-finite numbers become null."""
    if isinstance(value, dict):
        return {str(name): json_value(item) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [json_value(item) for item in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value
