"""Train the second stage, which corrects predicted vehicles by their images, on simulated drives.

python -m benchmarks.train_second_stage ROOT [ROOT ...] [--out FILE] [--epochs 40] [--workers 2]
python -m benchmarks.train_second_stage ROOT [ROOT ...] --real ROOT --out FILE --epochs 5

Each ROOT is a dataset of `appocc simulate` in the towns of the training. Vehicles are those that the shipped
network predicts there. With `--real` the shipped second stage is trained on, and a third of the examples are vehicles
that the weights `street` predict in the first 24 key frames of a recording with ground-truth maps. The same seed
gives the same weights on the same machine.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from appocc.inference.second_stage.refiner import DEFAULT, WEIGHTS_FOLDER, shipped_network
from benchmarks.second_stage.examples import Examples, Source, read_examples
from benchmarks.second_stage.training import train, write_network

SEED, VERSIONS = 0, 2
# Of a recording: versions of each vehicle, and key frames.
REAL_VERSIONS, REAL_FRAMES = 6, 24


def main(arguments: Sequence[str] | None = None) -> None:
    """Train and write the network."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("roots", type=Path, nargs="+")
    parser.add_argument("--out", type=Path, default=WEIGHTS_FOLDER / f"{DEFAULT}.safetensors", help="weights file")
    parser.add_argument("--epochs", type=float, default=40.0)
    parser.add_argument("--versions", type=int, default=VERSIONS, help=f"of each simulated vehicle ({VERSIONS})")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--real", type=Path, help="recording with ground-truth maps")
    options = parser.parse_args(arguments)
    sources = [Source(root, options.versions, SEED) for root in options.roots]
    examples = Examples.concatenated([read_examples(source, options.workers) for source in sources])
    print(f"{len(examples.score)} examples", flush=True)
    real = start = None
    if options.real is not None:
        recorded = Source(options.real, REAL_VERSIONS, SEED, "street", "groundtruth", REAL_FRAMES)
        real, start = read_examples(recorded, options.workers), shipped_network()
    write_network(train(examples, options.epochs, SEED, real, start), options.out)


if __name__ == "__main__":
    main()
