"""`appocc weights`: show the model card of a weights file, write weights for distribution, and exchange them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from cli.common import JsonOption, WeightsOption, emit, in_path, local_out_path, say

app = typer.Typer(
    name="weights",
    help="Show a weights file, write one for distribution, or exchange it as a folder.",
    no_args_is_help=True,
)


@app.command()
def show(
    file: Annotated[
        Path | None,
        typer.Argument(
            metavar="FILE",
            parser=in_path,
            help="Weights file, or the name of shipped ones: appocc (default) or street.",
        ),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Show the model card of a weights file: training data, figures, thresholds.

    Example: appocc weights show runs/small/best.safetensors
    """
    from appocc.inference.loading import weights_file
    from appocc.training.shipping import describe_weights

    card = describe_weights(weights_file(file))
    if as_json:
        emit(card)
        return
    for line in _lines(card):
        say(line)


@app.command()
def ship(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE", parser=in_path, help="Weights of a training, such as runs/small/best.safetensors."
        ),
    ],
    out: Annotated[Path, typer.Option("--out", parser=local_out_path, help="Output file, *.safetensors.")],
    figures: Annotated[
        Path | None,
        typer.Option(parser=in_path, help="Output of `appocc eval bev --json` for their maps of unseen places."),
    ] = None,
    command: Annotated[
        list[str] | None, typer.Option(help="A command that made the data or the weights; can be repeated.")
    ] = None,
) -> None:
    """Write weights in float16, with their origin and figures in the model card.

    Example: appocc weights ship runs/small/best.safetensors --figures eval.json --out mine.safetensors
    """
    from appocc.training.shipping import read_figures, ship_weights

    ship_weights(file, out, read_figures(figures) if figures else None, command or ())
    say(f"{out}: {out.stat().st_size / 1e6:.1f} MB")


@app.command()
def push(
    target: Annotated[
        str, typer.Argument(metavar="DIR", help="Folder to write, or hf://OWNER/NAME[@REVISION] (extra hub).")
    ],
    weights: WeightsOption = None,
    licence: Annotated[
        str | None,
        typer.Option(
            "--license", help="Identifier on the model card; default: mit for shipped weights, else unknown."
        ),
    ] = None,
) -> None:
    """Write weights in the layout of the Hugging Face Hub: model.safetensors, config.json, README.md.

    Example: appocc weights push DIR --weights mine.safetensors --license cc-by-4.0
    """
    from appocc.inference.loading import weights_file
    from appocc.training.hub_folder import push_weights

    say(f"{push_weights(weights_file(weights), target, licence)}: written")


@app.command()
def pull(
    source: Annotated[
        str, typer.Argument(metavar="DIR", help="Folder of weights, or hf://OWNER/NAME[@REVISION] (extra hub).")
    ],
    out: Annotated[Path, typer.Option("--out", parser=local_out_path, help="Output file, *.safetensors.")],
) -> None:
    """Check a folder in the layout of the Hugging Face Hub, and write its weights to a file.

    Example: appocc weights pull hf://OWNER/NAME --out mine.safetensors
    """
    from appocc.training.hub_folder import pull_weights

    pull_weights(source, out)
    say(f"{out}: {out.stat().st_size / 1e6:.1f} MB")


def _lines(card: dict[str, Any]) -> list[str]:
    """Return the model card as lines of text."""
    from appocc.bevmap import CLASSES

    size = f"{card['parameters'] / 1e6:.1f} million parameters, {card['bytes'] / 1e6:.1f} MB"
    kind = "occupancy and appearance" if card["appearance"] else "occupancy"
    lines = [f"{card['file']}: {card['network']}, {card['setting']} degrees, {kind}; {size}"]
    pairs = zip(CLASSES, card["thresholds"], strict=True)
    lines.append(f"thresholds: {', '.join(f'{name} {share:.2f}' for name, share in pairs)}")
    if card.get("training") and card.get("step") is not None:
        how = card["training"]["train"]
        lines.append(f"training: {card['step']} steps of {how['batch']} samples, seed {how['seed']}")
    if card.get("validation"):
        lines.append(f"validation: {_shares(card['validation']['best_iou'])}")
    if card.get("figures"):
        figures = card["figures"]
        at = figures.get("iou_at_threshold") or figures["iou"]
        lines.append(f"unseen places ({figures['samples']} samples): {_shares(at)}")
    lines += [f"made by: {command}" for command in card.get("commands", ())]
    return [*lines, card["attribution"]] if card.get("attribution") else lines


def _shares(iou: dict[str, float | None]) -> str:
    """Return IoU by class, in the order of the classes; the keys of a card are sorted."""
    from appocc.bevmap import CLASSES

    shares = (f"{name} {100 * (iou[name] or 0):.1f}" for name in CLASSES if name in iou)
    return "IoU " + ", ".join(shares) + " percent"
