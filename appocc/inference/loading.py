"""Load a predictor from a weights file, or from the weights shipped with the package."""

from __future__ import annotations

from pathlib import Path

import torch

from appocc.bevmap import CLASSES
from appocc.errors import DataError
from appocc.files import digest_of
from appocc.inference.predictor import CellStage, Predictor, Refine, Weights
from appocc.inference.second_stage.cell_refiner import CellRefiner
from appocc.inference.second_stage.refiner import DEFAULT, SecondStage
from appocc.models.batch_norm_folding import fold_batch_norms
from appocc.models.shipped import PACKAGED, find_weights, shipped_weights
from appocc.models.weights import load_model, read_thresholds
from appocc.typing import PathLike


def weights_file(weights: PathLike | None) -> Path:
    """Return the path of a weights file, also of shipped ones by their name; None: the default of the package.

    Raises:
        DataError: if the package has no weights.
    """
    if weights is None and not PACKAGED.is_file():
        raise DataError("no weights come with this version of appocc; name a file with --weights")
    return PACKAGED if weights is None else find_weights(weights)


def load_predictor(
    weights: PathLike | None = None,
    device: torch.device | None = None,
    second_stage: Refine | None = None,
    cell_stage: CellStage | None = None,
) -> Predictor:
    """Load a predictor from a weights file or the name of shipped weights; None: the default of the package.

    It runs on the given device, by default on the first GPU or else on the CPU. The default second stage is the
    shipped one of these weights or of the default ones, for networks that predict objects. The default weights
    have a stage of cells; others have none, since what a lane line is depends on the maps of their training.

    Raises:
        DataError: if the package has no weights, or the file is missing or damaged.
    """
    path = weights_file(weights)
    model, card = load_model(path)
    digest = digest_of(path)
    chosen = device or torch.device("cuda" if torch.cuda.is_available() else "cpu")
    thresholds = dict(zip(CLASSES, read_thresholds(card), strict=True))
    name, least_score = f"{card['network']} ({path.name})", float(card.get("object_threshold", 0.5))
    identity = Weights(name, digest, thresholds, least_score)
    shipped = {file: name for name, file in shipped_weights().items()}.get(path)
    if second_stage is None and model.parts.objects:
        second_stage = SecondStage.shipped(chosen, shipped or DEFAULT)
    if cell_stage is None and shipped is not None:
        cell_stage = CellRefiner.shipped(chosen, shipped)
    return Predictor(fold_batch_norms(model), identity, chosen, second_stage, cell_stage)
