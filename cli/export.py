"""`appocc export`: a network as ONNX or OpenVINO."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cli.common import JsonOption, VersionOption, WeightsOption, emit, in_path, local_out_path, progress, say

if TYPE_CHECKING:
    from appocc.export.run import ExportSource

_STEPS = 5


class Format(StrEnum):
    """Output formats."""

    onnx = "onnx"
    openvino = "openvino"


_ENDINGS = {Format.onnx: ".onnx", Format.openvino: ".xml"}


def export(
    out: Annotated[
        Path,
        typer.Option(
            "--out", parser=local_out_path, metavar="FILE", help="Output file: .onnx, or .xml for OpenVINO."
        ),
    ],
    root: Annotated[
        Path | None,
        typer.Argument(metavar="ROOT", parser=in_path, help="Dataset whose camera rig and images are used."),
    ] = None,
    rig: Annotated[
        str | None, typer.Option("--rig", help="Name or YAML file of a camera rig, instead of ROOT; default: paper.")
    ] = None,
    scene: Annotated[str | None, typer.Option("--scene", help="Scene of ROOT; default: the first.")] = None,
    weights: WeightsOption = None,
    runs: Annotated[int, typer.Option(min=1, help="Comparisons with torch per input and number of threads.")] = 4,
    int8: Annotated[
        bool,
        typer.Option(
            "--int8", help="Convolutions in INT8, calibrated on all scenes of ROOT, or --scene; for OpenVINO."
        ),
    ] = False,
    form: Annotated[Format | None, typer.Option("--format", help="Format of FILE; default: by its suffix.")] = None,
    version: VersionOption = None,
    as_json: JsonOption = False,
) -> None:
    """Export a network for one camera rig, compared with torch. Exit 1, without a file, if the outputs differ.

    Example: appocc export --weights F --rig rig.yaml --out model.onnx
    """
    from appocc.errors import DataError
    from appocc.export.run import export as export_float
    from appocc.export.run import export_int8

    if form is not None and out.suffix.lower() != _ENDINGS[form]:
        raise DataError(f"{out}: expected a name that ends in {_ENDINGS[form]} for {form}")
    if int8 and root is None:
        raise DataError("expected ROOT with --int8, whose images it is calibrated on, got none")
    source = _source(root, rig, scene, version, all_scenes=int8)
    with progress("export", _STEPS) as advance:
        if int8:
            done = export_int8(weights, source, out, advance)
        else:
            done = export_float(weights, source, out, runs, advance)
    if as_json:
        kind = "agreement" if int8 else "parity"
        emit({"files": [str(file) for file in done.files], kind: done.check.as_json(), "card": done.card})
    size = sum(file.stat().st_size for file in done.files)
    say(f"{', '.join(map(str, done.files))}: {size / 1e6:.1f} MB, {done.card['network']} for rig {source.name}")
    say("\n".join(done.check.lines()))


def _source(
    root: Path | None, rig: str | None, scene: str | None, version: str | None, *, all_scenes: bool
) -> ExportSource:
    """Return the camera rig to export for, with the frames of one scene or, without `scene`, of all.

    Raises:
        DataError: if both a dataset and a rig are given, or the dataset is damaged.
        NotFoundError: if there is no such scene or rig.
    """
    from appocc.errors import DataError
    from appocc.export.run import ExportSource, source_from_inputs
    from appocc.inference.inputs import dataset_inputs
    from appocc.nuscenes import Dataset
    from appocc.rigs import DEFAULT, read_rig

    if root is None:
        for option, value in (("--scene", scene), ("--version", version)):
            if value is not None:
                raise DataError(f"expected ROOT with {option}, got none")
        name = DEFAULT if rig is None else rig
        return ExportSource(read_rig(name), Path(name).name)
    if rig is not None:
        raise DataError("expected either ROOT or --rig, got both")
    dataset = Dataset(root, version)
    if not dataset.scenes:
        raise DataError(f"{root}: expected a scene, got none")
    chosen = dataset.scene(scene) if scene else dataset.scenes[0]
    scenes = dataset.scenes if all_scenes and scene is None else [chosen]
    return source_from_inputs(dataset_inputs(dataset, scenes), f"{chosen.name} of {root.resolve().name}")
