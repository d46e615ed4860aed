"""What a training is told: a YAML file with overrides `key=value`, checked before anything is begun."""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import yaml
from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from appocc.errors import DataError
from appocc.yaml_file import parse_yaml, read_yaml

Share = Annotated[float, Field(ge=0, le=1)]
NotNegative = Annotated[float, Field(ge=0)]
Positive = Annotated[float, Field(gt=0)]
Count = Annotated[int, Field(ge=1)]
PerClass = tuple[NotNegative, NotNegative, NotNegative]
_MOST_TOLD = 100


class _Part(BaseModel):
    """Nothing unknown, nothing changed later, no NaN."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class DataConfig(_Part):
    """Where samples come from.

    Attributes:
        train: dataset root in the nuScenes schema.
        val: the one that thresholds and the best checkpoint are chosen on; or
        held_out: so many samples at the end of each scene of `train`, which then are not trained on.
        source: whose maps are the truth, as in `bev/SOURCE`.
        packs: folder for the packed samples, which are made once.
        workers: threads or processes that read ahead.
    """

    train: str
    val: str | None = None
    held_out: Annotated[int, Field(ge=0)] = 0
    source: str = "exact"
    packs: str = "runs/packs"
    workers: Annotated[int, Field(ge=0, le=256)] = 1

    @model_validator(mode="after")
    def _one_validation(self) -> DataConfig:
        if (self.val is None) == (self.held_out == 0):
            raise ValueError("expected either val or held_out (the other null, or 0)")
        return self


class TrainConfig(_Part):
    """How the weights are moved.

    Attributes:
        steps: of the optimizer; or
        minutes: spent on steps (evaluations not counted); the schedule follows the share of the budget that is used.
        batch: samples of a forward pass, of each process.
        accumulate: forward passes of a step.
        lr: highest learning rate.
        weight_decay: of matrices and kernels; norms and biases have none.
        clip: longest gradient.
        ema: how much of the averaged weights stays with each step.
        warmup: share of the budget until `lr` is reached.
        precision: of the forward pass.
        threads: of torch on the CPU; None leaves it to torch.
        seed: of everything that is drawn.
        device: auto takes a GPU where one is.
    """

    steps: Count | None = None
    minutes: Positive | None = None
    batch: Annotated[int, Field(ge=1, le=65_536)] = 8
    accumulate: Annotated[int, Field(ge=1, le=65_536)] = 1
    lr: Annotated[float, Field(gt=0, le=1000)] = 2e-3
    weight_decay: Annotated[float, Field(ge=0, le=1000)] = 1e-2
    clip: Positive = 5.0
    ema: Annotated[float, Field(ge=0, lt=1)] = 0.998
    warmup: Share = 0.1
    precision: Literal["fp32", "bf16"] = "fp32"
    threads: Annotated[int, Field(ge=1, le=1024)] | None = None
    seed: Annotated[int, Field(ge=0, lt=2**31)] = 0
    device: Literal["auto", "cpu", "cuda"] = "auto"

    @model_validator(mode="after")
    def _one_budget(self) -> TrainConfig:
        if (self.steps is None) == (self.minutes is None):
            raise ValueError("expected either steps or minutes (the other null)")
        return self


class LossConfig(_Part):
    """What counts how much; road, vehicle, lane where there are three.

    Attributes:
        occupancy: binary cross-entropy, or the focal loss (Lin et al. 2017).
        classes: weight of each class; 0 leaves it out.
        pos_weight: of cells that are on, against one that is off.
        focal_gamma: how far the focal loss looks away from what is right already.
        colour: weight of the L1 of colours, which are 0..1.
        vehicles: weight of a vehicle's cell among those whose colour counts.
        depth: weight of the pictures' depth.
        kind: weight of what the pictures show.
    """

    occupancy: Literal["bce", "focal"] = "bce"
    classes: PerClass = (1.0, 1.0, 1.0)
    pos_weight: PerClass = (1.0, 4.0, 4.0)
    focal_gamma: NotNegative = 2.0
    colour: NotNegative = 1.0
    vehicles: NotNegative = 4.0
    depth: NotNegative = 0.1
    kind: NotNegative = 0.1


class AugmentConfig(_Part):
    """How far training samples are changed; all 0 leaves them as they are.

    Attributes:
        yaw_deg: the ego frame is turned by up to so much.
        shift_m: and moved along x and y by up to so much.
        mirror: share of samples that are mirrored left to right.
        brightness: of each sample and its map, by up to this share.
        contrast: likewise.
        saturation: likewise.
        cameras_dropped: up to so many cameras are left out.
        extrinsic_deg: cameras are believed to be turned by up to so much.
        extrinsic_m: and to be moved by up to so much.
    """

    yaw_deg: Annotated[float, Field(ge=0, le=180)] = 20.0
    shift_m: Annotated[float, Field(ge=0, le=40)] = 4.0
    mirror: Share = 0.5
    brightness: Share = 0.2
    contrast: Share = 0.2
    saturation: Share = 0.2
    cameras_dropped: Annotated[int, Field(ge=0, le=5)] = 0
    extrinsic_deg: Annotated[float, Field(ge=0, le=10)] = 0.0
    extrinsic_m: Annotated[float, Field(ge=0, le=1)] = 0.0


class EvaluateConfig(_Part):
    """When and on what the averaged weights are looked at.

    Attributes:
        every_steps: and once more at the end.
        samples: the first so many of the validation set, all of it where None.
        norm_batches: training batches over which batch norms' statistics are estimated before it.
    """

    every_steps: Count = 200
    samples: Count | None = None
    norm_batches: Annotated[int, Field(ge=0)] = 24


class SaveConfig(_Part):
    """When the state is written.

    Attributes:
        every_steps: after so many steps,
        every_minutes: or so many minutes, whichever is first.
        tensorboard: write the metrics for TensorBoard too (the extra `tensorboard`).
    """

    every_steps: Count = 500
    every_minutes: Positive = 5.0
    tensorboard: bool = False


class Config(_Part):
    """A training, whole.

    Attributes:
        network: name in the registry of networks.
        setting: cameras and grid, 360 or 180.
        appearance: colour as well as occupancy.
        init: file of weights to begin with, of the same network and setting; `packaged`: those that come along; None
            begins with nothing learnt.
        data: see `DataConfig`; so with the others.
        train: the optimizer.
        losses: what counts.
        augment: changes of samples.
        evaluate: validation.
        save: the state.
    """

    network: str = "appocc"
    setting: Literal["360", "180"] = "360"
    appearance: bool = True
    init: str | None = None
    data: DataConfig
    train: TrainConfig
    losses: LossConfig = LossConfig()
    augment: AugmentConfig = AugmentConfig()
    evaluate: EvaluateConfig = EvaluateConfig()
    save: SaveConfig = SaveConfig()

    @field_validator("setting", mode="before")
    @classmethod
    def _number_or_text(cls, value: object) -> object:
        # YAML reads an unquoted 360 as a number.
        return str(value) if type(value) is int else value

    def as_yaml(self) -> str:
        """Text that `read_config` reads as the same."""
        return yaml.safe_dump(self.model_dump(mode="json"), sort_keys=False)

    def differences(self, other: Config) -> list[str]:
        """Dotted keys at which two trainings differ."""
        mine, theirs = _flat(self.model_dump(mode="json")), _flat(other.model_dump(mode="json"))
        return [key for key, value in mine.items() if theirs[key] != value]


def read_config(path: Path, overrides: Sequence[str] = ()) -> Config:
    """A training from a YAML file; overrides such as `train.lr=1e-3` replace what it says.

    Raises:
        DataError: if the file cannot be read, or says something that no training can be told.
    """
    values = read_yaml(path)
    if not isinstance(values, dict):
        raise DataError(f"{path}: expected keys such as data and train, got {type(values).__name__}")
    replaced = dict(_override(values, text) for text in overrides)
    try:
        return Config.model_validate(values)
    except ValidationError as error:
        raise DataError(_complaint(path, error, replaced)) from error


def _override(values: dict[Any, Any], text: str) -> tuple[str, str]:
    """Put one `key=value` into nested values; the key and the text."""
    key, equals, value = text.partition("=")
    parts = key.split(".")
    if not equals or not all(parts):
        raise DataError(f"'{text}': expected key=value, such as train.lr=1e-3")
    for part in parts[:-1]:
        if not isinstance(values.setdefault(part, {}), dict):
            raise DataError(f"'{text}': expected a key, but '{part}' is a value")
        values = values[part]
    try:
        values[parts[-1]] = parse_yaml(value)
    except ValueError as error:
        raise DataError(f"'{text}': no valid YAML value ({error})") from error
    return key, text


def _complaint(path: Path, error: ValidationError, replaced: dict[str, str]) -> str:
    """The first thing that is wrong, and where."""
    first = error.errors()[0]
    keys = [str(part) for part in first["loc"]]
    key = ".".join(keys)
    by = [text for name, text in replaced.items() if key == name or key.startswith(f"{name}.")]
    place = f"{path} with {by[0]}" if by else f"{path}"
    if first["type"] == "extra_forbidden":
        known = _names(keys[:-1])
        near = difflib.get_close_matches(keys[-1], known, n=1)
        guess = f" (did you mean {'.'.join([*keys[:-1], *near])}?)" if near else ""
        return f"{place}: {key}: no such key{guess}; expected one of {', '.join(known)}"
    if first["type"] == "missing":
        return f"{place}: {key}: expected a value, got none"
    message = first["msg"].removeprefix("Value error, ").replace("Input should be", "expected")
    got = "" if first["type"] == "value_error" else f", got {repr(first['input'])[:_MOST_TOLD]}"
    return f"{place}: {key}: {message}{got}"


def _names(keys: Sequence[str]) -> list[str]:
    """Names that may stand below these keys."""
    part: type[BaseModel] = Config
    for key in keys:
        inner = part.model_fields[key].annotation
        assert isinstance(inner, type)
        part = inner
    return list(part.model_fields)


def _flat(values: dict[str, Any], above: str = "") -> dict[str, Any]:
    """Nested keys as dotted ones."""
    found: dict[str, Any] = {}
    for key, value in values.items():
        found |= _flat(value, f"{above}{key}.") if isinstance(value, dict) else {above + key: value}
    return found
