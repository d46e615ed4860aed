"""The state of a training in one file, written whole or not at all; two are kept."""

from __future__ import annotations

import json
import re
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file
from torch import Tensor, nn
from torch.optim import Optimizer

from appocc.errors import DataError
from appocc.files import whole_file

_NAME = re.compile(r"state-(\d+)\.safetensors")
_KEPT = 2


@dataclass
class Progress:
    """How far a training has come; JSON values only.

    Random numbers need no state: those of a step come from the seed and the step's number.

    Attributes:
        step: steps taken.
        seconds: spent on them.
        evaluated: step of the latest evaluation, -1 before the first.
        best_step: of the best one, -1 before the first.
        best_iou: its mean IoU.
        window: losses and times of the steps since the latest line of metrics.
        first_losses: totals of the first steps, against which divergence is told.
        smooth_loss: running mean of the totals.
    """

    step: int = 0
    seconds: float = 0.0
    evaluated: int = -1
    best_step: int = -1
    best_iou: float = -1.0
    window: list[dict[str, float]] = field(default_factory=list)
    first_losses: list[float] = field(default_factory=list)
    smooth_loss: float = 0.0


def save_state(folder: Path, progress: Progress, model: nn.Module, average: nn.Module, optimizer: Optimizer) -> Path:
    """Write `state-STEP.safetensors` (progress as JSON in its header); older ones but one are removed.

    Raises:
        DataError: if it cannot be written.
    """
    tensors = {f"model.{name}": value for name, value in model.state_dict().items()}
    tensors |= {f"average.{name}": value for name, value in average.state_dict().items()}
    for name, moments in zip(_names(model, optimizer), _moments(optimizer), strict=True):
        tensors |= {f"optimizer.{kind}.{name}": value for kind, value in moments.items()}
    # Layouts such as channels_last are no matter of the file.
    plain = {name: value.detach().cpu().contiguous() for name, value in tensors.items()}
    path = folder / f"state-{progress.step:08d}.safetensors"
    with whole_file(path) as temporary:
        save_file(plain, temporary, {"progress": json.dumps(asdict(progress))})
    for old in states(folder)[_KEPT:]:
        old.unlink()
    return path


def states(folder: Path) -> list[Path]:
    """Files of states, the latest first."""
    found = [path for path in folder.glob("state-*.safetensors") if _NAME.fullmatch(path.name)]
    return sorted(found, key=lambda path: path.name, reverse=True)


def load_state(path: Path, model: nn.Module, average: nn.Module, optimizer: Optimizer) -> Progress:
    """Put a state into the parts of a training.

    Raises:
        DataError: if the file is damaged or of other parts.
    """
    try:
        with safe_open(path, framework="pt") as file:
            progress = Progress(**json.loads(file.metadata()["progress"]))
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
        model.load_state_dict(_below("model.", tensors))
        average.load_state_dict(_below("average.", tensors))
        _load_moments(optimizer, _names(model, optimizer), _below("optimizer.", tensors))
    except (OSError, SafetensorError, KeyError, TypeError, ValueError, RuntimeError) as error:
        raise DataError(f"{path}: no state of this training ({' '.join(str(error).split())[:200]})") from error
    return progress


def _load_moments(optimizer: Optimizer, names: list[str], tensors: dict[str, Tensor]) -> None:
    saved: dict[str, Any] = optimizer.state_dict()
    kinds = sorted({name.split(".", 1)[0] for name in tensors})
    parameters = [each for group in optimizer.param_groups for each in group["params"]]
    state: dict[int, dict[str, Tensor]] = {}
    for number, (name, parameter) in enumerate(zip(names, parameters, strict=True)):
        for kind in kinds:
            value = tensors[f"{kind}.{name}"]
            # In the layout of the parameter, as the optimizer itself would have made it.
            like = torch.empty_like(parameter) if value.shape == parameter.shape else torch.empty_like(value)
            state.setdefault(number, {})[kind] = like.copy_(value).detach()
    optimizer.load_state_dict({**saved, "state": state})


def _moments(optimizer: Optimizer) -> list[dict[str, Tensor]]:
    parameters = (each for group in optimizer.param_groups for each in group["params"])
    return [optimizer.state.get(parameter, {}) for parameter in parameters]


def _names(model: nn.Module, optimizer: Optimizer) -> list[str]:
    """Names of the optimizer's parameters in its order."""
    names = {id(parameter): name for name, parameter in model.named_parameters()}
    return [names[id(parameter)] for group in optimizer.param_groups for parameter in group["params"]]


def _below(prefix: str, tensors: dict[str, Tensor]) -> dict[str, Tensor]:
    return {name.removeprefix(prefix): value for name, value in tensors.items() if name.startswith(prefix)}
