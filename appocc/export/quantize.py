"""INT8 quantization of an OpenVINO model by NNCF, calibrated on frames of a dataset.

Only the dense convolutions are quantized. They hold most of the multiplications; the layers between them cost more
accuracy than they save time.
"""

from __future__ import annotations

import contextlib
import io
import logging
import os
import statistics
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from appocc.bevmap import CLASSES
from appocc.checks import BoolArray
from appocc.export.clips import Clip, run_clip
from appocc.export.extras import import_package
from appocc.export.graph import MEMORY, NEXT_MEMORY, OCCUPANCY
from appocc.export.parity import one_thread
from appocc.export.runtimes import Inputs, Outputs, Runner

# Smallest IoU of the quantized with the float32 predictions, mean over classes.
_LEAST_AGREEMENT = 0.85
_QUANTIZED = {"Convolution", "Constant", "Parameter", "Result", "Convert"}  # and what holds their weights and inputs


@dataclass(frozen=True, kw_only=True)
class Agreement:
    """Agreement of a quantized file with its network on frames that were not used for calibration.

    Attributes:
        iou: IoU of the cells above the threshold, by class; 1 if neither has any.
        frames: number of frames.
        calibrated: number of frames that the quantization was calibrated on.
        eager_s: median time of a frame in torch, seconds.
        exported_s: median time of a frame in the file with one thread, seconds.
    """

    iou: Mapping[str, float]
    frames: int
    calibrated: int
    eager_s: float
    exported_s: float

    @property
    def holds(self) -> bool:
        """Whether the predictions are close enough for the file to be of use."""
        return float(np.mean(list(self.iou.values()))) >= _LEAST_AGREEMENT

    def as_json(self) -> dict[str, Any]:
        """Return the values for JSON."""
        return {
            "iou": dict(self.iou),
            "frames": self.frames,
            "calibrated_frames": self.calibrated,
            "median_ms": {"torch": self.eager_s * 1e3, "exported": self.exported_s * 1e3},
        }

    def lines(self) -> list[str]:
        """Return the report as lines of text."""
        shares = ", ".join(f"{name} {100 * value:.1f}" for name, value in self.iou.items())
        return [
            f"INT8, calibrated on {self.calibrated} frames",
            f"IoU in percent with the cells of the network, {self.frames} other frames: {shares}",
            f"median, one thread: torch {self.eager_s * 1e3:.0f} ms, exported {self.exported_s * 1e3:.0f} ms",
        ]


def calibration_inputs(run: Runner, clips: Iterable[Clip]) -> list[Inputs]:
    """Return the inputs of all frames, each with the memory that the network has at that frame."""
    inputs: list[Inputs] = []
    for clip in clips:
        outputs = run_clip(run, clip)
        inputs.append(clip[0])
        for frame, before in zip(clip[1:], outputs, strict=False):
            inputs.append({**frame, MEMORY: before[NEXT_MEMORY]})
    return inputs


def quantize(model: Any, inputs: Sequence[Inputs]) -> Any:
    """Return an OpenVINO model with INT8 convolutions, with the ranges of its layers on the given inputs.

    Raises:
        AppoccError: if NNCF is not installed.
    """
    os.environ.setdefault("NNCF_CI", "1")  # without it, NNCF sends usage statistics
    nncf = import_package("nncf")
    float_layers = sorted({layer.get_type_name() for layer in model.get_ordered_ops()} - _QUANTIZED)
    nncf.set_log_level(logging.ERROR)
    with contextlib.redirect_stdout(io.StringIO()):  # progress bars
        return nncf.quantize(
            model,
            nncf.Dataset([dict(each) for each in inputs]),
            preset=nncf.QuantizationPreset.MIXED,
            subset_size=len(inputs),
            ignored_scope=nncf.IgnoredScope(types=float_layers, validate=False),
        )


def measure_agreement(
    network: Runner, exported: Runner, clips: Iterable[Clip], thresholds: Sequence[float], calibrated: int
) -> Agreement:
    """Compare the occupied cells of a quantized file with those of its network.

    Args:
        network: runner of the network.
        exported: runner of the file with one thread, which gets its own memory back.
        clips: clips of frames.
        thresholds: thresholds of the classes.
        calibrated: number of frames that the quantization was calibrated on.
    """
    counts, frames = np.zeros((2, len(CLASSES))), 0
    seconds: dict[str, list[float]] = {"eager": [], "exported": []}
    for clip in clips:
        answers = {}
        for name, run in (("eager", network), ("exported", exported)):
            with one_thread():
                start = time.perf_counter()
                answers[name] = run_clip(run, clip)
                seconds[name].append((time.perf_counter() - start) / len(clip))
        for wanted, found in zip(*answers.values(), strict=True):
            want, got = occupied(wanted, thresholds), occupied(found, thresholds)
            counts += (want & got).sum((1, 2)), (want | got).sum((1, 2))
            frames += 1
    both, either = counts
    iou = np.where(either > 0, both / np.maximum(either, 1), 1.0)
    return Agreement(
        iou=dict(zip(CLASSES, iou.tolist(), strict=True)),
        frames=frames,
        calibrated=calibrated,
        eager_s=statistics.median(seconds["eager"]),
        exported_s=statistics.median(seconds["exported"]),
    )


def occupied(outputs: Outputs, thresholds: Sequence[float]) -> BoolArray:
    """Return the cells (3, X, Y) of the first sample at or above the thresholds of the classes."""
    return np.asarray(outputs[OCCUPANCY][0] >= np.asarray(thresholds)[:, None, None])
