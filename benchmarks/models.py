"""Inference time from images to the grid: batch 1, medians of interleaved runs, relative to Lift-Splat-Shoot.

    OMP_NUM_THREADS=2 python -m benchmarks.models [--runs 9] [--setting 360] [--no-compile]

`appocc, all parts` has depth, a memory of an earlier frame, and objects. With the extra `export`, the formats of
`appocc export` are timed too. Weights are random: time does not depend on
them. Images are in memory, and the plan of a rig is computed once, as in a vehicle. The speed of bf16 depends on the
machine (AMX or AVX512-BF16; emulated and slow elsewhere): its capabilities are printed.
"""

from __future__ import annotations

import argparse
import os
import statistics
import tempfile
import time
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import NamedTuple

import torch
from rich.console import Console
from rich.table import Table
from torch import Tensor
from torch.utils.flop_counter import FlopCounterMode

from appocc.camera import CameraRig
from appocc.checks import Float32Array
from appocc.errors import AppoccError
from appocc.export.convert import to_onnx, to_openvino, write_onnx, write_openvino
from appocc.export.graph import ELAPSED, IMAGES, MEMORY, PAST_FROM_NOW, ExportGraph, input_shapes
from appocc.export.quantize import quantize
from appocc.export.runtimes import Runner, open_onnx, open_openvino
from appocc.models.base import BEVModel, ViewTransformPlan
from appocc.models.batch_norm_folding import fold_batch_norms
from appocc.models.memory import Past
from appocc.models.model_spec import MODEL_SPECS, ModelSpec, Parts
from appocc.models.registry import build
from appocc.rigs import read_rig

_FLAGS = ("avx2", "avx512f", "avx512_bf16", "amx_bf16", "amx_int8", "asimd", "bf16")
ALL_PARTS = Parts(depth=True, memory=True, objects=True)
Forward = Callable[[Tensor, ViewTransformPlan], object]


class Way(NamedTuple):
    """A network and its mode of execution.

    Attributes:
        name: name of the network.
        how: mode of execution, for the table.
        model: its parameters and multiplications are counted.
        forward: the timed function.
        bf16: whether it runs under autocast.
    """

    name: str
    how: str
    model: BEVModel
    forward: Forward
    bf16: bool = False

    def run(self, images: Tensor, plan: ViewTransformPlan) -> float:
        """Return the seconds of one forward pass."""
        start = time.perf_counter()
        with self.precision():
            self.forward(images, plan)
        return time.perf_counter() - start

    def precision(self) -> AbstractContextManager[object]:
        """Return the context of the number format."""
        return torch.autocast("cpu", torch.bfloat16) if self.bf16 else nullcontext()


def ways(spec: ModelSpec, rig: CameraRig, compiled: bool) -> list[Way]:
    """Return all networks and modes to time, the reference first."""
    torch.manual_seed(0)
    found = [Way(name, "float32, eager", model := build(name, spec).eval(), model) for name in ("lss", "paper")]
    for name, parts in (("appocc", Parts()), ("appocc, all parts", ALL_PARTS)):
        model = build("appocc", spec, parts=parts).eval()
        past = _past(spec) if parts.memory else None
        found += torch_ways(name, model, past, compiled) + exported_ways(name, model, past, rig)
    return found


def torch_ways(name: str, model: BEVModel, past: Past | None, compiled: bool) -> list[Way]:
    """Return a network in torch, as it is and optimised."""
    last = fold_batch_norms(model).to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    found = [
        Way(name, "float32, eager", model, _with(model, past)),
        Way(name, "float32, eager, channels last, folded", model, _with(last, past)),
        Way(name, "bf16, eager, channels last, folded", model, _with(last, past), bf16=True),
    ]
    if compiled:
        from torch._inductor import config

        config.freezing = True
        found += [
            Way(name, "float32, compiled", model, _with(torch.compile(last), past)),
            Way(name, "bf16, compiled", model, _with(torch.compile(last), past), bf16=True),
        ]
    return found


def exported_ways(name: str, model: BEVModel, past: Past | None, rig: CameraRig) -> list[Way]:
    """Return the exported formats of a network; empty without the extra."""
    threads = torch.get_num_threads()
    graph = ExportGraph(model, rig)
    random = {each: torch.rand(shape).numpy() for each, shape in graph.shapes.items()}
    with tempfile.TemporaryDirectory() as folder:
        onnx = Path(folder) / "model.onnx"
        try:
            proto = to_onnx(graph, "")
            write_onnx(proto, onnx)
            runs = {"float32, exported, ONNX": open_onnx(onnx, threads)}
            for how, found in (
                ("float32, exported, OpenVINO", to_openvino(proto)),
                ("int8 convolutions, OpenVINO", quantize(to_openvino(proto), [random])),
            ):
                # OpenVINO maps the file of the weights into memory: another model needs files of its own.
                xml, values = (Path(folder) / f"{len(runs)}.{ending}" for ending in ("xml", "bin"))
                write_openvino(found, "", xml, values)
                runs[how] = open_openvino(xml, values, threads)
        except AppoccError as error:
            print(error)
            return []
    return [Way(name, how, model, _of_arrays(run, past)) for how, run in runs.items()]


def _past(spec: ModelSpec) -> Past:
    """Return a memory of half a second and 1.5 m ago."""
    memory = torch.rand(input_shapes(spec, ALL_PARTS, 0)[MEMORY])
    motion = torch.tensor([[[[1.0, 0.0, 1.5], [0.0, 1.0, 0.0]]]])
    return Past(memory, motion, torch.tensor([[0.5]]), torch.ones(1, 1))


def _with(model: Callable[..., object], past: Past | None) -> Forward:
    return lambda images, plan: model(images, plan, past)


def _of_arrays(run: Runner, past: Past | None) -> Forward:
    inputs: dict[str, Float32Array] = {}
    if past is not None and past.state is not None:
        memory, motion, elapsed = past.state, past.past_from_now[0], past.elapsed_s[0]
        inputs = {MEMORY: memory.numpy(), PAST_FROM_NOW: motion.numpy(), ELAPSED: elapsed.numpy()}
    return lambda images, plan: run({IMAGES: images.numpy(), **inputs})


def giga_macs(way: Way, images: Tensor, plan: ViewTransformPlan) -> float:
    """Count the multiply-adds of convolutions and matrix products, in 1e9."""
    with FlopCounterMode(display=False) as counter:
        way.model(images, plan)
    return float(counter.get_total_flops()) / 2e9


def measure(spec: ModelSpec, runs: int, compiled: bool) -> Table:
    """Time all modes in turn, so that other load on the machine affects all equally."""
    rig = CameraRig(tuple(read_rig("paper")[channel] for channel in spec.channels))
    images = torch.rand(1, len(rig), 3, spec.height_px, spec.width_px)
    working: list[tuple[Way, ViewTransformPlan]] = []
    failed: list[tuple[Way, str]] = []
    table = Table("network", "how", "median ms", "of lss", "times faster", "parameters", "GMAC")
    candidates = ways(spec, rig, compiled)
    with torch.inference_mode():
        for way in candidates:
            plan = way.model.plan([rig])
            try:
                way.run(images, plan)  # compiles
                way.run(images, plan)
                working.append((way, plan))
            except Exception as error:  # torch.compile needs a C++ compiler and fails with nearly any error
                failed.append((way, str(error).splitlines()[0][:60]))
        seconds: list[list[float]] = [[] for _ in working]
        for _ in range(runs):
            for own, (way, plan) in zip(seconds, working, strict=True):
                own.append(way.run(images, plan))
        unit = statistics.median(seconds[0])
        for own, (way, plan) in zip(seconds, working, strict=True):
            median = statistics.median(own)
            weights = sum(each.numel() for each in way.model.parameters()) / 1e6
            figures = f"{median * 1e3:.0f}", f"{median / unit:.3f}", f"{unit / median:.2f}"
            table.add_row(way.name, way.how, *figures, f"{weights:.2f} M", f"{giga_macs(way, images, plan):.1f}")
    for way, reason in failed:
        table.add_row(way.name, way.how, reason, "", "", "", "")
    return table


def machine() -> str:
    """Describe the machine: processor, bf16 support, threads."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.exists() else []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    flags = {flag for line in lines if line.startswith(("flags", "Features")) for flag in line.split()}
    has = ", ".join(flag for flag in _FLAGS if flag in flags) or "unknown"
    name = names[0] if names else "unknown processor"
    return f"{name}; has {has}; {torch.get_num_threads()} threads; torch {torch.__version__}"


def main() -> None:
    """Parse arguments, measure, print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=9, help="runs of each mode; the median counts")
    parser.add_argument("--setting", choices=sorted(MODEL_SPECS), default="360")
    parser.add_argument("--no-compile", action="store_true", help="skip torch.compile")
    arguments = parser.parse_args()
    if "OMP_NUM_THREADS" in os.environ:
        torch.set_num_threads(int(os.environ["OMP_NUM_THREADS"]))
    console = Console(width=140)
    console.print(machine())
    console.print(measure(MODEL_SPECS[arguments.setting], arguments.runs, not arguments.no_compile))


if __name__ == "__main__":
    main()
