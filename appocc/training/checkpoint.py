"""Checkpoints: the full state of a training in one file, written atomically; the latest two are kept."""

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


@dataclass(kw_only=True)
class TrainingProgress:
    """Progress of a training; JSON values only.

    Random generators have no state to save: they are seeded by the step.

    Attributes:
        step: number of steps taken.
        seconds: time spent on them.
        evaluated: step of the latest evaluation, -1 before the first.
        best_step: step of the best evaluation, -1 before the first.
        best_iou: mean IoU of the best evaluation.
        window: losses and times of the steps since the latest line of metrics.
        first_losses: total losses of the first steps, the reference for divergence.
        smooth_loss: running mean of the total loss.
    """

    step: int = 0
    seconds: float = 0.0
    evaluated: int = -1
    best_step: int = -1
    best_iou: float = -1.0
    window: list[dict[str, float]] = field(default_factory=list)
    first_losses: list[float] = field(default_factory=list)
    smooth_loss: float = 0.0


def save_checkpoint(
    folder: Path, progress: TrainingProgress, model: nn.Module, ema_model: nn.Module, optimizer: Optimizer
) -> Path:
    """Write `state-STEP.safetensors` with the progress as JSON in its header; remove all but the latest two.

    Raises:
        DataError: if it cannot be written.
    """
    tensors = {f"model.{name}": value for name, value in model.state_dict().items()}
    tensors |= {f"average.{name}": value for name, value in ema_model.state_dict().items()}
    for name, state in zip(_parameter_names(model, optimizer), _optimizer_states(optimizer), strict=True):
        tensors |= {f"optimizer.{key}.{name}": value for key, value in state.items()}
    # The file does not store memory layouts such as channels_last.
    plain = {name: value.detach().cpu().contiguous() for name, value in tensors.items()}
    path = folder / f"state-{progress.step:08d}.safetensors"
    with whole_file(path) as temporary:
        save_file(plain, temporary, {"progress": json.dumps(asdict(progress))})
    for old in list_checkpoints(folder)[_KEPT:]:
        old.unlink()
    return path


def list_checkpoints(folder: Path) -> list[Path]:
    """Return the checkpoint files, the latest first."""
    found = [path for path in folder.glob("state-*.safetensors") if _NAME.fullmatch(path.name)]
    return sorted(found, key=lambda path: path.name, reverse=True)


def load_checkpoint(path: Path, model: nn.Module, ema_model: nn.Module, optimizer: Optimizer) -> TrainingProgress:
    """Load a checkpoint into network, EMA and optimizer; return its progress.

    Raises:
        DataError: if the file is damaged or belongs to another run.
    """
    try:
        with safe_open(path, framework="pt") as file:
            progress = TrainingProgress(**json.loads(file.metadata()["progress"]))
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
        model.load_state_dict(_with_prefix("model.", tensors))
        ema_model.load_state_dict(_with_prefix("average.", tensors))
        _load_optimizer(optimizer, _parameter_names(model, optimizer), _with_prefix("optimizer.", tensors))
    except (OSError, SafetensorError, KeyError, TypeError, ValueError, RuntimeError) as error:
        reason = " ".join(str(error).split())[:200]
        raise DataError(f"{path}: checkpoint belongs to another run or is damaged ({reason})") from error
    return progress


def _load_optimizer(optimizer: Optimizer, names: list[str], tensors: dict[str, Tensor]) -> None:
    saved: dict[str, Any] = optimizer.state_dict()
    keys = sorted({name.split(".", 1)[0] for name in tensors})
    parameters = [each for group in optimizer.param_groups for each in group["params"]]
    state: dict[int, dict[str, Tensor]] = {}
    for number, (name, parameter) in enumerate(zip(names, parameters, strict=True)):
        for key in keys:
            value = tensors[f"{key}.{name}"]
            # Same memory layout as the parameter, as the optimizer itself creates it.
            like = torch.empty_like(parameter) if value.shape == parameter.shape else torch.empty_like(value)
            state.setdefault(number, {})[key] = like.copy_(value).detach()
    optimizer.load_state_dict({**saved, "state": state})


def _optimizer_states(optimizer: Optimizer) -> list[dict[str, Tensor]]:
    parameters = (each for group in optimizer.param_groups for each in group["params"])
    return [optimizer.state.get(parameter, {}) for parameter in parameters]


def _parameter_names(model: nn.Module, optimizer: Optimizer) -> list[str]:
    """Return the names of the parameters in the order of the optimizer."""
    names = {id(parameter): name for name, parameter in model.named_parameters()}
    return [names[id(parameter)] for group in optimizer.param_groups for parameter in group["params"]]


def _with_prefix(prefix: str, tensors: dict[str, Tensor]) -> dict[str, Tensor]:
    return {name.removeprefix(prefix): value for name, value in tensors.items() if name.startswith(prefix)}
