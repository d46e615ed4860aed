"""Training configuration: a YAML file with overrides `key=value`, validated before the training starts."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import yaml
from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from appocc.errors import DataError, shown
from appocc.jsonparts import first_problem
from appocc.yaml_file import parse_yaml, read_yaml

Share = Annotated[float, Field(ge=0, le=1)]
NotNegative = Annotated[float, Field(ge=0)]
Positive = Annotated[float, Field(gt=0)]
Count = Annotated[int, Field(ge=1)]
PerClass = tuple[NotNegative, NotNegative, NotNegative]


class _Section(BaseModel):
    """Section of the configuration: no unknown keys, immutable, finite numbers."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class DataConfig(_Section):
    """Training and validation data.

    Attributes:
        train: root of the training dataset in the nuScenes schema, or a list of roots.
        val: root of the validation dataset, for choosing thresholds and the best checkpoint; this
            or `held_out`.
        held_out: number of samples at the end of each scene of `train` for validation instead of training.
        source: source of the true maps, as in `bev/SOURCE`.
        packs: folder of the packed datasets.
        workers: threads that read ahead, processes on a GPU and while packing.
        clip: consecutive samples of a scene that are trained together; more than 1 trains the memory.
    """

    train: str | tuple[str, ...]
    val: str | None = None
    held_out: Annotated[int, Field(ge=0)] = 0
    source: str = "exact"
    packs: str = "runs/packs"
    workers: Annotated[int, Field(ge=0, le=256)] = 1
    clip: Annotated[int, Field(ge=1, le=64)] = 1

    @field_validator("train", mode="before")
    @classmethod
    def _one_or_several(cls, value: object) -> object:
        roots = [value] if isinstance(value, str) else value
        if not isinstance(roots, list | tuple) or not roots or not all(isinstance(root, str) for root in roots):
            raise ValueError(f"expected a folder or a list of folders, got {shown(value)}")
        return value

    @property
    def train_roots(self) -> tuple[str, ...]:
        """Roots of the training datasets."""
        return (self.train,) if isinstance(self.train, str) else self.train

    @model_validator(mode="after")
    def _one_validation(self) -> DataConfig:
        if (self.val is None) == (self.held_out == 0):
            raise ValueError("expected either val or held_out (the other null, or 0)")
        return self


class TrainConfig(_Section):
    """Optimization.

    Attributes:
        steps: budget in optimizer steps; this or `minutes`.
        minutes: budget in minutes of steps, evaluations not counted; schedules follow the spent share of the budget.
        batch: samples per forward pass and process.
        accumulate: forward passes per step (gradient accumulation).
        lr: highest learning rate.
        weight_decay: weight decay of matrices and kernels; no weight decay on norms and biases.
        clip: maximum gradient norm.
        ema: decay of the exponential moving average of the weights.
        warmup: share of the budget until `lr` is reached.
        precision: precision of the forward pass; auto: bf16 where the processor is made for it, else fp32.
        threads: CPU threads of torch; None: torch's default.
        seed: random seed.
        device: auto uses a GPU if there is one.
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
    precision: Literal["auto", "fp32", "bf16"] = "auto"
    threads: Annotated[int, Field(ge=1, le=1024)] | None = None
    seed: Annotated[int, Field(ge=0, lt=2**31)] = 0
    device: Literal["auto", "cpu", "cuda"] = "auto"

    @model_validator(mode="after")
    def _one_budget(self) -> TrainConfig:
        if (self.steps is None) == (self.minutes is None):
            raise ValueError("expected either steps or minutes (the other null)")
        return self


class LossConfig(_Section):
    """Loss weights; three values are for road, vehicle, lane.

    Attributes:
        occupancy: binary cross-entropy or focal loss (Lin et al. 2017).
        classes: weight of each class; 0 ignores the class.
        pos_weight: weight of occupied cells relative to free cells.
        focal_gamma: exponent of the focal loss, which down-weights easy cells.
        colour: weight of the L1 colour loss, colours 0..1.
        vehicles: weight of vehicle cells in the colour loss.
        depth: weight of the auxiliary depth loss.
        kind: weight of the auxiliary pixel-class loss; images without pixel classes add nothing.
        centre: weight of the object centres.
        box: weight of the boxes of objects.
        paint: weight of the paint of vehicles.
    """

    occupancy: Literal["bce", "focal"] = "bce"
    classes: PerClass = (1.0, 1.0, 1.0)
    pos_weight: PerClass = (1.0, 4.0, 4.0)
    focal_gamma: NotNegative = 2.0
    colour: NotNegative = 1.0
    vehicles: NotNegative = 4.0
    depth: NotNegative = 0.1
    kind: NotNegative = 0.1
    centre: NotNegative = 0.2
    box: NotNegative = 0.2
    paint: NotNegative = 0.5


class AugmentConfig(_Section):
    """Data augmentation; 0 switches a transform off.

    Attributes:
        yaw_deg: largest rotation of the ego frame to either side.
        shift_m: largest shift of the ego frame along x and y.
        mirror: share of samples that are mirrored left to right.
        brightness: largest relative change of brightness, of images and map alike.
        contrast: largest relative change of contrast.
        saturation: largest relative change of saturation.
        camera_style: share of samples with the look of another camera: tone, sharpness, noise, compression, dirt.
        cameras_dropped: largest number of dropped cameras.
        extrinsic_deg: largest rotation error of the camera extrinsics.
        extrinsic_m: largest translation error of the camera extrinsics.
    """

    yaw_deg: Annotated[float, Field(ge=0, le=180)] = 20.0
    shift_m: Annotated[float, Field(ge=0, le=40)] = 4.0
    mirror: Share = 0.5
    brightness: Share = 0.2
    contrast: Share = 0.2
    saturation: Share = 0.2
    camera_style: Share = 0.0
    cameras_dropped: Annotated[int, Field(ge=0, le=5)] = 0
    extrinsic_deg: Annotated[float, Field(ge=0, le=10)] = 0.0
    extrinsic_m: Annotated[float, Field(ge=0, le=1)] = 0.0


class EvaluateConfig(_Section):
    """Evaluation of the EMA weights.

    Attributes:
        every_steps: steps between evaluations; the last step is always evaluated.
        samples: number of validation samples, the first ones; None: all.
        norm_batches: training batches for re-estimating the batch-norm statistics before an evaluation.
    """

    every_steps: Count = 200
    samples: Count | None = None
    norm_batches: Annotated[int, Field(ge=0)] = 24


class SaveConfig(_Section):
    """Checkpoints and logs.

    Attributes:
        every_steps: steps between checkpoints.
        every_minutes: minutes between checkpoints, if that is sooner.
        tensorboard: write the metrics for TensorBoard too (the extra `tensorboard`).
    """

    every_steps: Count = 500
    every_minutes: Positive = 5.0
    tensorboard: bool = False


class Config(_Section):
    """Configuration of a training.

    Attributes:
        network: name in the registry of networks.
        setting: cameras and grid, 360 or 180.
        appearance: predict appearance as well as occupancy.
        parts: optional parts of the network: depth, memory, objects.
        init: file of initial weights for the same network and setting; `packaged`: the shipped weights; `street`: the
            shipped ones for real streets; None: train from scratch.
        data: training and validation data.
        train: optimization.
        losses: loss weights.
        augment: data augmentation.
        evaluate: evaluation during the training.
        save: checkpoints and logs.
    """

    network: str = "appocc"
    setting: Literal["360", "180"] = "360"
    appearance: bool = True
    parts: tuple[Literal["depth", "memory", "objects"], ...] = ()
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

    @model_validator(mode="after")
    def _whole_clips(self) -> Config:
        if self.train.batch % self.data.clip:
            raise ValueError(
                f"train.batch: expected a multiple of data.clip={self.data.clip}, got {self.train.batch}"
            )
        if "memory" in self.parts and self.data.clip < 2:
            raise ValueError("data.clip: expected 2 or more, which train the part memory, got 1")
        return self

    def as_yaml(self) -> str:
        """Return the configuration as YAML; `read_config` restores it."""
        return yaml.safe_dump(self.model_dump(mode="json"), sort_keys=False)

    def differences(self, other: Config) -> list[str]:
        """Return the dotted keys whose values differ."""
        mine, theirs = _flat(self.model_dump(mode="json")), _flat(other.model_dump(mode="json"))
        return [key for key, value in mine.items() if theirs[key] != value]


def read_config(path: Path, overrides: Sequence[str] = ()) -> Config:
    """Read a configuration from a YAML file; overrides such as `train.lr=1e-3` replace its values.

    Raises:
        DataError: if the file cannot be read, or a key or value is invalid.
    """
    values = read_yaml(path)
    if not isinstance(values, dict):
        raise DataError(f"{path}: expected keys such as data and train, got {type(values).__name__}")
    replaced = dict(_override(values, text) for text in overrides)
    try:
        return Config.model_validate(values)
    except ValidationError as error:
        raise DataError(f"{_place(path, error, replaced)}: {first_problem(error, Config)}") from error


def _override(values: dict[Any, Any], text: str) -> tuple[str, str]:
    """Set one `key=value` in nested values; return the key and the text."""
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


def _place(path: Path, error: ValidationError, replaced: dict[str, str]) -> str:
    """Return the file of the first validation error, with the override that it is about."""
    key = ".".join(map(str, error.errors()[0]["loc"]))
    overriding = [text for name, text in replaced.items() if key == name or key.startswith(f"{name}.")]
    return f"{path} with {overriding[0]}" if overriding else f"{path}"


def _flat(values: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    """Flatten nested keys to dotted keys."""
    found: dict[str, Any] = {}
    for key, value in values.items():
        found |= _flat(value, f"{prefix}{key}.") if isinstance(value, dict) else {prefix + key: value}
    return found
