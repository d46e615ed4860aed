"""Camera rigs in YAML files: shipped rigs by name, others by path."""

from __future__ import annotations

from pathlib import Path

from appocc.camera import CameraRig
from appocc.errors import NotFoundError
from appocc.rigs.rig_file import read_rig_file
from appocc.rigs.source_rig import SourceRig as SourceRig
from appocc.typing import PathLike
from appocc.yaml_file import read_yaml

FOLDER = Path(__file__).parent
DEFAULT = "paper"


def rig_names() -> tuple[str, ...]:
    """Return the names of the shipped rigs."""
    return tuple(sorted(path.stem for path in FOLDER.glob("*.yaml")))


def read_source_rig(name_or_path: PathLike) -> SourceRig:
    """Read a shipped rig by its name, or a rig from a YAML file, with cameras of any lens.

    Raises:
        NotFoundError: if there is neither a shipped rig nor a file of this name.
        DataError: if the file is damaged or not a valid rig.
    """
    path = FOLDER / f"{name_or_path}.yaml" if str(name_or_path) in rig_names() else Path(name_or_path)
    if not path.is_file():
        raise NotFoundError(f"{name_or_path}: no rig of this name ({', '.join(rig_names())}) and no such file")
    return read_rig_file(path, read_yaml(path))


def read_rig(name_or_path: PathLike) -> CameraRig:
    """Read the pinhole cameras of a rig, as `read_source_rig`: those of wide lenses are views cut out of them.

    Raises:
        NotFoundError: if there is neither a shipped rig nor a file of this name.
        DataError: if the file is damaged or not a valid rig.
    """
    return read_source_rig(name_or_path).rig
