"""Examples for the second stage of cells: maps that the shipped network predicts in simulated drives, with truth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple
from zlib import crc32

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from appocc.bevmap import load_map
from appocc.checks import BoolArray, ByteArray, Float32Array
from appocc.frame import Frame
from appocc.inference.inputs import dataset_inputs
from appocc.inference.loading import load_predictor
from appocc.inference.second_stage.cell_network import CELL_PARTS, CORRECTED
from appocc.inference.second_stage.cell_refiner import cell_inputs
from appocc.inference.second_stage.ground_colours import GroundColours, GroundView
from appocc.nuscenes.dataset import Dataset
from appocc.training.batches.camera_style import CameraStyle, apply_style, draw_style
from benchmarks.second_stage.examples import Source, map_scenes


class CellExamples(NamedTuple):
    """N examples.

    Attributes:
        logits: (N, 3, X, Y) float16 predicted logits.
        rgb: (N, 27, X, Y) uint8 colours of the parts of cells.
        seen: (N, X, Y) uint8, number of parts that a camera sees.
        truth: (N, 2, X, Y) bool, road and lane.
        known: (N, 2, X, Y) bool, whether they are known.
    """

    logits: NDArray[np.float16]
    rgb: ByteArray
    seen: ByteArray
    truth: BoolArray
    known: BoolArray

    @classmethod
    def concatenated(cls, parts: Sequence[CellExamples]) -> CellExamples:
        """Return the examples of all parts."""
        return cls._make(np.concatenate(arrays) for arrays in zip(*parts, strict=True))


class _Recorder:
    """Second stage of cells that records its inputs and changes nothing."""

    def __init__(self) -> None:
        self._ground = GroundColours()

    def reset(self) -> None:
        """Forget all frames: the next frame is the first of a drive."""
        self._ground.reset()

    def __call__(self, occupancy: Float32Array, view: GroundView) -> Float32Array:
        """Record the inputs of the next frame."""
        self.inputs = cell_inputs(occupancy, *self._ground(view), view.grid)
        return occupancy


def read_cell_examples(source: Source, workers: int) -> CellExamples:
    """Return the examples of a source, in the order of its scenes, read by a number of processes."""
    return CellExamples.concatenated(map_scenes(source, _of_scenes, workers))


def _of_scenes(source: Source, names: Sequence[str]) -> CellExamples:
    recorder = _Recorder()
    predictor = load_predictor(source.weights, cell_stage=recorder)
    dataset = Dataset(source.root)
    parts = []
    for scene in (scene for scene in dataset.scenes if scene.name in names):
        rng = np.random.default_rng([source.seed, crc32(scene.name.encode())])
        for version in range(source.versions):
            predictor.reset()
            style = draw_style(rng) if version else None
            for given in dataset_inputs(dataset, [scene])[: source.most]:
                frame = given.read().frame
                predictor(frame if style is None else _styled(frame, style, rng))
                inputs, true = recorder.inputs, load_map(dataset.root, source.against, given.token)
                parts.append(
                    CellExamples(
                        inputs.logits.numpy().astype(np.float16),
                        (255 * inputs.rgb).round().byte().numpy(),
                        (CELL_PARTS * inputs.seen[:, 0]).round().byte().numpy(),
                        true.occupancy[None, CORRECTED] > 0.5,
                        true.occupancy_valid[None, CORRECTED],
                    )
                )
    return CellExamples.concatenated(parts)


def _styled(frame: Frame, style: CameraStyle, rng: Generator) -> Frame:
    """Return a frame whose images are as another camera system takes them."""
    styled = apply_style(np.stack(list(frame.images.values())), style, rng)
    return replace(frame, images=dict(zip(frame.images, styled, strict=True)))
