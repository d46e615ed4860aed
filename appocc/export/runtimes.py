"""Runtimes of exported files: onnxruntime and OpenVINO."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from appocc.checks import Float32Array
from appocc.export.extras import import_package

# Arrays by name.
Inputs = Mapping[str, Float32Array]
Outputs = Mapping[str, NDArray[Any]]
Runner = Callable[[Inputs], Outputs]


def open_onnx(path: Path, threads: int) -> Runner:
    """Open an ONNX file in onnxruntime on the CPU.

    Raises:
        AppoccError: if onnxruntime is not installed.
    """
    onnxruntime = import_package("onnxruntime")
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    options.log_severity_level = 3
    # More threads than cores would spin while they wait.
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    session = onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
    names = [output.name for output in session.get_outputs()]

    def run(inputs: Inputs) -> Outputs:
        return dict(zip(names, session.run(names, dict(inputs)), strict=True))

    return run


def open_openvino(xml: Path, weights: Path, threads: int) -> Runner:
    """Open OpenVINO files on the CPU, in float32 even if the processor prefers another precision.

    Raises:
        AppoccError: if openvino is not installed.
    """
    openvino = import_package("openvino")
    core = openvino.Core()
    how = {"INFERENCE_PRECISION_HINT": "f32", "INFERENCE_NUM_THREADS": threads, "NUM_STREAMS": 1}
    compiled = core.compile_model(core.read_model(str(xml), str(weights)), "CPU", how)
    # Merged operations leave an output several names.
    names = [name for output in compiled.outputs for name in output.names]

    def run(inputs: Inputs) -> Outputs:
        found = compiled(dict(inputs))
        return {name: np.array(found[name]) for name in names}

    return run
