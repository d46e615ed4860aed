"""Train the second stage of cells, which corrects road and lane of a map by its images, on simulated drives.

python -m benchmarks.train_cell_stage ROOT [ROOT ...] [--out FILE] [--epochs 5] [--workers 2]

Each ROOT is a dataset of `appocc simulate` in the towns of the training. The maps are those that the shipped network
predicts there, once from the images as they are and once from those of another camera. The same seed gives the same
weights on the same machine.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from appocc.inference.second_stage.cell_refiner import CELL_WEIGHTS_FOLDER, cell_distances
from appocc.inference.second_stage.refiner import DEFAULT
from appocc.models.model_spec import MODEL_SPECS
from benchmarks.second_stage.cell_examples import CellExamples, read_cell_examples
from benchmarks.second_stage.cell_training import train_cells
from benchmarks.second_stage.examples import Source
from benchmarks.second_stage.training import write_network

SEED, VERSIONS, SETTING = 0, 2, "360"


def main(arguments: Sequence[str] | None = None) -> None:
    """Train and write the network."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("roots", type=Path, nargs="+")
    parser.add_argument(
        "--out", type=Path, default=CELL_WEIGHTS_FOLDER / f"{DEFAULT}.safetensors", help="weights file"
    )
    parser.add_argument("--epochs", type=float, default=5.0)
    parser.add_argument("--versions", type=int, default=VERSIONS, help=f"of each simulated key frame ({VERSIONS})")
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args(arguments)
    sources = [Source(root, options.versions, SEED) for root in options.roots]
    examples = CellExamples.concatenated([read_cell_examples(source, options.workers) for source in sources])
    print(f"{len(examples.seen)} examples", flush=True)
    distance = cell_distances(MODEL_SPECS[SETTING].grid)
    write_network(train_cells(examples, options.epochs, distance, SEED), options.out)


if __name__ == "__main__":
    main()
