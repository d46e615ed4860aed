"""Camera rigs in YAML files: shipped rigs by name, others by path."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from appocc.camera import Camera, CameraRig
from appocc.checks import FloatArray
from appocc.ego_vehicle import EgoVehicle
from appocc.errors import DataError, NotFoundError, ShapeError
from appocc.geometry import transform
from appocc.rigs.source_rig import SourceRig as SourceRig
from appocc.rigs.source_rig import pinhole_source
from appocc.typing import PathLike
from appocc.yaml_file import read_yaml

FOLDER = Path(__file__).parent
DEFAULT = "paper"

_Side = Annotated[int, Field(ge=8, le=8192)]
_Row = tuple[float, float, float]


class _CameraModel(BaseModel):
    """A camera in a rig file; see docs/simulator.md."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)

    size_px: tuple[_Side, _Side]
    position_m: _Row
    yaw_deg: float
    pitch_deg: float = 0.0
    roll_deg: float = 0.0
    fov_deg: Annotated[float, Field(gt=1, lt=175)] | None = None
    centre_px: tuple[float, float] | None = None
    intrinsic: tuple[_Row, _Row, _Row] | None = None

    @model_validator(mode="after")
    def _check_intrinsic(self) -> _CameraModel:
        if (self.fov_deg is None) == (self.intrinsic is None):
            raise ValueError("expected either fov_deg or intrinsic")
        if self.intrinsic is not None and self.centre_px is not None:
            raise ValueError("centre_px goes with fov_deg; an intrinsic has its own")
        return self


class _EgoVehicleModel(BaseModel):
    """The ego vehicle in a rig file; omitted dimensions have the default of `EgoVehicle`."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)

    length_m: float = EgoVehicle.length_m
    width_m: float = EgoVehicle.width_m
    rear_overhang_m: float = EgoVehicle.rear_overhang_m
    turning_circle_m: float = EgoVehicle.turning_circle_m


class _RigModel(BaseModel):
    """A rig file."""

    model_config = ConfigDict(extra="forbid")

    cameras: Annotated[
        dict[Annotated[str, Field(pattern=r"^CAM_[A-Z0-9_]{1,40}$")], _CameraModel], Field(min_length=1)
    ]
    ego_vehicle: _EgoVehicleModel = _EgoVehicleModel()


def rig_names() -> tuple[str, ...]:
    """Return the names of the shipped rigs."""
    return tuple(sorted(path.stem for path in FOLDER.glob("*.yaml")))


def read_source_rig(name_or_path: PathLike) -> SourceRig:
    """Read the source cameras and the pinhole cameras of a shipped rig, or of a rig in a YAML file.

    Raises:
        NotFoundError: if there is neither a shipped rig nor a file of this name.
        DataError: if the file is damaged or not a valid rig.
    """
    return pinhole_source(read_rig(name_or_path))


def read_rig(name_or_path: PathLike) -> CameraRig:
    """Read a shipped rig by its name, or a rig from a YAML file.

    Raises:
        NotFoundError: if there is neither a shipped rig nor a file of this name.
        DataError: if the file is damaged or not a valid rig.
    """
    path = FOLDER / f"{name_or_path}.yaml" if str(name_or_path) in rig_names() else Path(name_or_path)
    if not path.is_file():
        raise NotFoundError(f"{name_or_path}: no rig of this name ({', '.join(rig_names())}) and no such file")
    values = read_yaml(path)
    try:
        found = _RigModel.model_validate(values)
        cameras = tuple(_camera(channel, model) for channel, model in found.cameras.items())
        return CameraRig(cameras, EgoVehicle(**found.ego_vehicle.model_dump()))
    except ValidationError as error:
        first: Any = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"] if part != "[key]") or "the file"
        raise DataError(f"{path}: invalid camera rig: {where}: {first['msg']}") from error
    except (ShapeError, ValueError) as error:
        raise DataError(f"{path}: invalid camera rig ({' '.join(str(error).split())})") from error


def _camera(channel: str, model: _CameraModel) -> Camera:
    width, height = model.size_px
    if model.intrinsic is not None:
        intrinsic = np.array(model.intrinsic)
    else:
        focal = width / 2 / np.tan(np.radians(model.fov_deg or 0.0) / 2)
        across, down = model.centre_px or ((width - 1) / 2, (height - 1) / 2)
        intrinsic = np.array([[focal, 0.0, across], [0.0, focal, down], [0.0, 0.0, 1.0]])
    rotation = _rotation(model.yaw_deg, model.pitch_deg, model.roll_deg)
    return Camera(channel, width, height, intrinsic, transform(rotation, model.position_m))


def _rotation(yaw_deg: float, pitch_deg: float, roll_deg: float) -> FloatArray:
    """Return the ego-from-camera rotation: yaw to the left, pitch down, roll clockwise seen from behind."""
    (cy, cp, cr), (sy, sp, sr) = (f(np.radians([yaw_deg, pitch_deg, roll_deg])) for f in (np.cos, np.sin))
    yaw = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    pitch = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    roll = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    forward_left_up_from_cam = np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])
    return np.asarray(yaw @ pitch @ roll @ forward_left_up_from_cam)
