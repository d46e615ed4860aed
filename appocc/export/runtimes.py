"""Exported files, loaded and run as their users do."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from appocc.checks import Float32Array
from appocc.export.extras import package
from appocc.export.graph import INPUT

Answers = Mapping[str, NDArray[Any]]
Run = Callable[[Float32Array], Answers]


def open_onnx(path: Path, threads: int) -> Run:
    """An ONNX file in onnxruntime on the CPU.

    Raises:
        AppoccError: if onnxruntime is not installed.
    """
    onnxruntime = package("onnxruntime")
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    options.log_severity_level = 3
    # More threads than cores would wait for each other at full speed.
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    session = onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
    names = [output.name for output in session.get_outputs()]

    def run(images: Float32Array) -> Answers:
        return dict(zip(names, session.run(names, {INPUT: images}), strict=True))

    return run


def open_openvino(xml: Path, weights: Path, threads: int) -> Run:
    """OpenVINO's files on the CPU, in float32 whatever the processor would rather use.

    Raises:
        AppoccError: if openvino is not installed.
    """
    openvino = package("openvino")
    core = openvino.Core()
    how = {"INFERENCE_PRECISION_HINT": "f32", "INFERENCE_NUM_THREADS": threads, "NUM_STREAMS": 1}
    compiled = core.compile_model(core.read_model(str(xml), str(weights)), "CPU", how)
    names = [output.any_name for output in compiled.outputs]

    def run(images: Float32Array) -> Answers:
        found = compiled({INPUT: images})
        return {name: np.array(found[name]) for name in names}

    return run
