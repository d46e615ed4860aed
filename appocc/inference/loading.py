"""A network from a file of weights, or from those that come with the package."""

from __future__ import annotations

from pathlib import Path

import torch

from appocc.bevmap import CLASSES
from appocc.errors import DataError
from appocc.files import digest_of
from appocc.inference.predictor import Predictor, Weights
from appocc.models.fused import fused
from appocc.models.weights import PACKAGED, load_model, thresholds_of


def weights_file(weights: Path | None) -> Path:
    """A file of weights; None: that of the package.

    Raises:
        DataError: if none comes with the package.
    """
    if weights is None and not PACKAGED.is_file():
        raise DataError("no weights come with this version of appocc; name a file with --weights")
    return weights or PACKAGED


def load_predictor(weights: Path | None, device: torch.device | None = None) -> Predictor:
    """The network of a file of weights; None: of those that come with the package.

    It runs on the first GPU, where there is one, unless a device is given.

    Raises:
        DataError: if there are none, or the file is missing or damaged.
    """
    path = weights_file(weights)
    model, card = load_model(path)
    digest = digest_of(path)
    chosen = device or torch.device("cuda" if torch.cuda.is_available() else "cpu")
    thresholds = dict(zip(CLASSES, thresholds_of(card), strict=True))
    return Predictor(fused(model), Weights(f"{card['network']} ({path.name})", digest, thresholds), chosen)
