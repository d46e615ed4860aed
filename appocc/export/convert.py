"""A graph to a file: ONNX by torch's exporter, and from that OpenVINO's own form."""

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
from appocc.export.extras import package
from appocc.export.graph import APPEARANCE, INPUT, OCCUPANCY, SEEN, Graph

# The newest that the exporter writes without converting; runtimes of the last three years read it.
OPSET = 20


def to_onnx(graph: Graph, shape: tuple[int, ...], card: str) -> Any:
    """The graph as an ONNX model; the same graph gives the same bytes.

    Args:
        graph: a network with a rig.
        shape: of its pictures, (1, N, 3, H, W).
        card: goes into the model's metadata.

    Raises:
        AppoccError: if the extra is not installed, or the graph cannot be translated.
    """
    onnx = package("onnx")
    package("onnxscript")
    names = [OCCUPANCY, APPEARANCE]
    images = torch.zeros(shape)
    try:
        with _quiet(), torch.no_grad():
            count = len(graph(images))
            program = torch.onnx.export(
                graph,
                (images,),
                input_names=[INPUT],
                output_names=names[:count],
                opset_version=OPSET,
                dynamo=True,
                external_data=False,
                verbose=False,
            )
    except torch.onnx.OnnxExporterError as error:
        raise AppoccError(f"torch cannot export this network ({str(error).strip().splitlines()[0]})") from error
    assert program is not None  # it is, of dynamo
    model = program.model_proto
    _forget(model)
    _add_seen(onnx, model, graph)
    model.metadata_props.add(key=ENTRY, value=card)
    onnx.checker.check_model(model)
    return model


def write_onnx(model: Any, path: Path) -> None:
    """Write an ONNX model to a file."""
    path.write_bytes(model.SerializeToString(deterministic=True))


def write_openvino(model: Any, card: str, xml: Path, weights: Path) -> None:
    """Write an ONNX model as OpenVINO's two files, in float32; the same model gives the same bytes."""
    openvino = package("openvino")
    found = openvino.Core().read_model(model.SerializeToString(deterministic=True))
    # Parts that OpenVINO makes itself are named by a count of all that the process ever made.
    for number, part in enumerate(found.get_ordered_ops()):
        if re.fullmatch(rf"{part.get_type_name()}_\d+", part.get_friendly_name()):
            part.set_friendly_name(f"{part.get_type_name()}_{number}")
    found.set_rt_info(card, [ENTRY])
    openvino.serialize(found, str(xml), str(weights))


def _forget(model: Any) -> None:
    """Drop what the exporter wrote for those who look for errors: it names files of this machine."""
    for part in (model, model.graph, *model.graph.node, *model.graph.value_info, *model.graph.initializer):
        del part.metadata_props[:]
        part.doc_string = ""
    for part in (*model.graph.input, *model.graph.output):
        del part.metadata_props[:]


def _add_seen(onnx: Any, model: Any, graph: Graph) -> None:
    """A constant as an output: the exporter itself gives large ones one name twice."""
    seen = graph.seen.numpy()
    constant = onnx.numpy_helper.from_array(seen, f"{SEEN}_by_rig")
    model.graph.initializer.append(constant)
    model.graph.node.append(onnx.helper.make_node("Identity", [constant.name], [SEEN], name=f"node_{SEEN}"))
    model.graph.output.append(onnx.helper.make_tensor_value_info(SEEN, onnx.TensorProto.BOOL, seen.shape))


@contextmanager
def _quiet() -> Iterator[None]:
    """Without what torch says of packages that nobody needs here, and of its own deprecated parts."""
    before = logging.root.manager.disable
    logging.disable(logging.WARNING)
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", category=FutureWarning, message=".*LeafSpec.*")
            warnings.filterwarnings("ignore", category=DeprecationWarning)
            yield
    finally:
        logging.disable(before)
