"""Train the second stage, which corrects predicted vehicles by their images, on simulated drives.

python -m benchmarks.train_second_stage ROOT [ROOT ...] [--out FILE] [--epochs 20] [--workers 2]

Each ROOT is a dataset of `appocc simulate` in the towns of the training. Vehicles are those that the shipped network
predicts there. The same seed gives the same weights on the same machine.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from safetensors.torch import save

from appocc.files import write_bytes
from appocc.inference.second_stage.network import CropNetwork
from appocc.inference.second_stage.refiner import WEIGHTS_PATH
from benchmarks.second_stage.examples import Examples, read_examples
from benchmarks.second_stage.training import train

SEED, VERSIONS = 0, 2


def write_network(network: CropNetwork, path: Path) -> None:
    """Write the weights of a network as float16."""
    state = network.state_dict()
    halves = {name: state[name].half() if state[name].is_floating_point() else state[name] for name in sorted(state)}
    write_bytes(path, save({name: tensor.contiguous() for name, tensor in halves.items()}))


def main(arguments: Sequence[str] | None = None) -> None:
    """Train and write the network."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("roots", type=Path, nargs="+")
    parser.add_argument("--out", type=Path, default=WEIGHTS_PATH, help="weights file (that of the package)")
    parser.add_argument("--epochs", type=float, default=20.0)
    parser.add_argument("--versions", type=int, default=VERSIONS, help=f"of each vehicle ({VERSIONS})")
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args(arguments)
    parts = [read_examples(root, options.versions, options.workers, SEED) for root in options.roots]
    examples = Examples.concatenated(parts)
    print(f"{len(examples.truth)} examples", flush=True)
    write_network(train(examples, options.epochs, SEED), options.out)


if __name__ == "__main__":
    main()
