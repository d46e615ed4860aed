"""What each optional part of the network gives: the same weights, trained on with each, at equal budget.

    OMP_NUM_THREADS=1 python -m benchmarks.parts SETS OUT [--steps 160] [--seeds 2] [--json]

SETS has the datasets `train`, `val` and `test` (docs/ablation.md tells how they are made). First the shipped weights
are cut down to the network without parts and trained on, so that they do without; all rows start from these weights.
New parts start without effect. A row is a run of `appocc train` in OUT/ROW-SEED and its maps of `test`, evaluated by
`appocc eval bev` at the thresholds of its best checkpoint. The same command resumes an interrupted study.
"""

from __future__ import annotations

import argparse
import json
import statistics
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from appocc.bevmap import CLASSES
from appocc.files import read_json, write_json
from appocc.models.registry import build
from appocc.models.shipped import PACKAGED
from appocc.models.weights import load_model, save_weights

ALL = ("depth", "memory", "objects")
# Row -> parts, and further settings of `appocc train`.
ROWS: dict[str, tuple[Sequence[str], Sequence[str]]] = {
    "none": ((), ()),
    "depth": (("depth",), ()),
    "memory": (("memory",), ()),
    "objects": (("objects",), ()),
    "all": (ALL, ()),
    "all, camera styles": (ALL, ("augment.camera_style=0.5",)),
}
_COMMON = (
    *("train.lr=8e-4", "train.ema=0.98", "train.warmup=0.05", "train.threads=1"),
    *("augment.camera_style=0", "augment.cameras_dropped=0", "evaluate.samples=60"),
)
_DONE = "done.json"
MEASURES = (*CLASSES, *(f"{name} within 20 m" for name in CLASSES), "L1 within 20 m")


def cut_down(path: Path) -> None:
    """Write the shipped weights without the layers of optional parts and their inputs to other layers."""
    full, card = load_model(PACKAGED)
    bare = build(card["network"], full.spec)
    given = full.state_dict()
    state = {
        key: given[key][:, : like.shape[1]] if like.ndim > 1 else given[key]
        for key, like in bare.state_dict().items()
        if key in given
    }
    bare.load_state_dict(bare.state_dict() | state)
    save_weights(path, bare, {"network": card["network"], "thresholds": card["thresholds"]})


def run(*arguments: str) -> str:
    """Run appocc and return its output; its progress goes to the terminal."""
    command = [sys.executable, "-m", "appocc", *arguments]
    return subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout


def train(
    sets: Path, out: Path, init: Path, steps: int, seed: int, parts: Sequence[str], more: Sequence[str]
) -> Path:
    """Train a row, or resume it, and return its best weights."""
    settings = (
        *(f"init={init}", f"data.train={sets / 'train'}", f"data.val={sets / 'val'}", f"parts=[{','.join(parts)}]"),
        *(f"train.steps={steps}", f"train.seed={seed}", f"evaluate.every_steps={steps // 2}", *_COMMON, *more),
    )
    best = out / "best.safetensors"
    if not (out / _DONE).is_file():
        run("train", "small", *settings, "--out", str(out), *(["--resume"] if best.is_file() else []))
        write_json(out / _DONE, {"steps": steps})
    return best


def measure(sets: Path, out: Path, weights: Path) -> dict[str, float]:
    """Return the accuracy of the maps of the test set, in percent and grey levels."""
    kept = out / "result.json"
    if not kept.is_file():
        source = f"parts-{out.name}"
        run(
            "infer",
            str(sets / "test"),
            "--weights",
            str(weights),
            "--no-pictures",
            "--out",
            str(sets / "test/bev" / source),
        )
        found = [
            json.loads(run("eval", "bev", str(sets / "test"), "--bev", source, "--against", "exact", *more, "--json"))
            for more in ((), ("--range", "20"))
        ]
        write_json(kept, found)
    return values_of(read_json(kept))


def values_of(found: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    """Return the measures of the evaluations over all cells and within 20 m."""
    everywhere, near = found
    iou = {name: 100 * everywhere["iou_at_threshold"][name] for name in CLASSES}
    close = {f"{name} within 20 m": 100 * near["iou_at_threshold"][name] for name in CLASSES}
    return {**iou, **close, "L1 within 20 m": near["appearance_l1"]}


def study(sets: Path, out: Path, steps: int, seeds: int) -> dict[str, list[dict[str, float]]]:
    """Run the rows without a result, the first seed of every row first, and return all measures by row."""
    start = out / "cut.safetensors"
    if not start.is_file():
        cut_down(start)
    base = train(sets, out / "start", start, steps, 99, (), ())
    found: dict[str, list[dict[str, float]]] = {name: [] for name in ROWS}
    for seed in range(seeds):
        for name, (parts, more) in ROWS.items():
            folder = out / f"{name.replace(', ', '-').replace(' ', '-')}-{seed}"
            found[name].append(measure(sets, folder, train(sets, folder, base, steps, seed, parts, more)))
    return found


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the study and print a table: means over seeds, and in brackets half the difference of the extremes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sets", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--steps", type=int, default=160, help="steps of each row (160)")
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args(arguments)
    options.out.mkdir(parents=True, exist_ok=True)
    found = study(options.sets, options.out, options.steps, options.seeds)
    if options.json:
        print(json.dumps(found))
        return
    table = Table("parts", *MEASURES)
    for name, runs in found.items():
        cells = [[values[measure] for values in runs] for measure in MEASURES]
        table.add_row(name, *(f"{statistics.mean(cell):.1f} ({(max(cell) - min(cell)) / 2:.1f})" for cell in cells))
    Console().print(table)


if __name__ == "__main__":
    main()
