"""Conversion of a graph to ONNX with torch's exporter, and from ONNX to OpenVINO."""

from __future__ import annotations

import logging
import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import torch

from appocc.errors import AppoccError
from appocc.export.card import ENTRY
from appocc.export.extras import import_package
from appocc.export.graph import SEEN, ExportGraph

# The newest opset that the exporter writes directly; runtimes of the last three years support it.
OPSET = 20


def to_onnx(graph: ExportGraph, card: str) -> Any:
    """Convert a graph to an ONNX model; the same graph gives the same bytes.

    Args:
        graph: network with a rig.
        card: model card for the metadata.

    Raises:
        AppoccError: if the extra is not installed, or the graph cannot be exported.
    """
    onnx = import_package("onnx")
    import_package("onnxscript")
    inputs = tuple(map(torch.zeros, graph.shapes.values()))
    try:
        with _quiet_export(), torch.no_grad():
            program = torch.onnx.export(
                graph,
                inputs,
                input_names=list(graph.shapes),
                output_names=list(graph(*inputs)),
                opset_version=OPSET,
                dynamo=True,
                external_data=False,
                verbose=False,
            )
    except torch.onnx.OnnxExporterError as error:
        raise AppoccError(f"torch cannot export this network ({str(error).strip().splitlines()[0]})") from error
    assert program is not None  # always with dynamo
    model = program.model_proto
    _remove_metadata(model)
    _add_seen(onnx, model, graph)
    model.metadata_props.add(key=ENTRY, value=card)
    onnx.checker.check_model(model)
    return model


def write_onnx(model: Any, path: Path) -> None:
    """Write an ONNX model to a file."""
    path.write_bytes(model.SerializeToString(deterministic=True))


def to_openvino(model: Any) -> Any:
    """Convert an ONNX model to an OpenVINO model in float32."""
    return import_package("openvino").Core().read_model(model.SerializeToString(deterministic=True))


def write_openvino(model: Any, card: str, xml: Path, weights: Path) -> None:
    """Write an OpenVINO model as its two files; the same model gives the same bytes."""
    # OpenVINO names its own operations by a counter of the process: make the names reproducible.
    for number, part in enumerate(model.get_ordered_ops()):
        if re.fullmatch(rf"{part.get_type_name()}_\d+", part.get_friendly_name()):
            part.set_friendly_name(f"{part.get_type_name()}_{number}")
    model.set_rt_info(card, [ENTRY])
    import_package("openvino").serialize(model, str(xml), str(weights))


def _remove_metadata(model: Any) -> None:
    """Remove the exporter's debugging metadata, which has file names of this machine."""
    for part in (model, model.graph, *model.graph.node, *model.graph.value_info, *model.graph.initializer):
        del part.metadata_props[:]
        part.doc_string = ""
    for part in (*model.graph.input, *model.graph.output):
        del part.metadata_props[:]


def _add_seen(onnx: Any, model: Any, graph: ExportGraph) -> None:
    """Add the visible cells as a constant output; the exporter itself gives large constants duplicate names."""
    seen = graph.seen.numpy()
    constant = onnx.numpy_helper.from_array(seen, f"{SEEN}_by_rig")
    model.graph.initializer.append(constant)
    model.graph.node.append(onnx.helper.make_node("Identity", [constant.name], [SEEN], name=f"node_{SEEN}"))
    model.graph.output.append(onnx.helper.make_tensor_value_info(SEEN, onnx.TensorProto.BOOL, seen.shape))


@contextmanager
def _quiet_export() -> Iterator[None]:
    """Suppress torch's messages about unused packages and its own deprecations."""
    before = logging.root.manager.disable
    logging.disable(logging.WARNING)
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", category=FutureWarning, message=".*LeafSpec.*")
            warnings.filterwarnings("ignore", category=DeprecationWarning)
            yield
    finally:
        logging.disable(before)
