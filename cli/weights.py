"""`appocc weights`: what weights are, and weights for others."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from cli.common import JsonOption, emit, out_path, say

app = typer.Typer(name="weights", help="What weights are; weights for others to use.", no_args_is_help=True)


@app.command()
def show(
    file: Annotated[
        Path | None, typer.Argument(metavar="FILE", help="File of weights; those of the package by default.")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Say what weights were made from, and what they can do.

    Example: appocc weights show runs/small/best.safetensors
    """
    from appocc.inference.loading import weights_file
    from appocc.training.shipping import describe_weights

    told = describe_weights(weights_file(file))
    if as_json:
        emit(told)
        return
    for line in _lines(told):
        say(line)


@app.command()
def ship(
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="Weights that a training left: runs/small/best.safetensors.")
    ],
    out: Annotated[Path, typer.Option("--out", parser=out_path, help="The new file, *.safetensors.")],
    figures: Annotated[
        Path | None, typer.Option(help="What `appocc eval bev --json` printed of their maps of unseen places.")
    ] = None,
    command: Annotated[
        list[str] | None, typer.Option(help="A command that made the data or the weights; several are possible.")
    ] = None,
) -> None:
    """Write weights at half the size (float16), with how they were made and how good they are on their card.

    Example: appocc weights ship runs/small/best.safetensors --figures eval.json --out mine.safetensors
    """
    from appocc.training.shipping import read_figures, ship_weights

    ship_weights(file, out, read_figures(figures) if figures else None, command or ())
    say(f"{out}: {out.stat().st_size / 1e6:.1f} MB")


def _lines(told: dict[str, Any]) -> list[str]:
    """The card for people."""
    from appocc.bevmap import CLASSES

    size = f"{told['parameters'] / 1e6:.1f} million parameters, {told['bytes'] / 1e6:.1f} MB"
    kind = "occupancy and appearance" if told["appearance"] else "occupancy"
    lines = [f"{told['file']}: {told['network']}, {told['setting']} degrees, {kind}; {size}"]
    pairs = zip(CLASSES, told["thresholds"], strict=True)
    lines.append(f"thresholds: {', '.join(f'{name} {share:.2f}' for name, share in pairs)}")
    if told.get("training") and told.get("step") is not None:
        how = told["training"]["train"]
        lines.append(f"training: {told['step']} steps of {how['batch']} samples, seed {how['seed']}")
    if told.get("validation"):
        lines.append(f"validation: {_shares(told['validation']['best_iou'])}")
    if told.get("figures"):
        figures = told["figures"]
        at = figures.get("iou_at_threshold") or figures["iou"]
        lines.append(f"unseen places ({figures['samples']} samples): {_shares(at)}")
    return [*lines, *(f"made by: {command}" for command in told.get("commands", ()))]


def _shares(iou: dict[str, float | None]) -> str:
    """By class, in their order: a card keeps its keys sorted."""
    from appocc.bevmap import CLASSES

    told = (f"{name} {100 * (iou[name] or 0):.1f}" for name in CLASSES if name in iou)
    return "IoU " + ", ".join(told) + " percent"
