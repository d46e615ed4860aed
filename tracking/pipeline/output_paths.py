"""Where tracks are written: never over what they are made from."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from appocc.errors import DataError
from appocc.files import plain_name
from tracking.io.kitti import input_folders


def check_apart(out: Path, inputs: Mapping[str, Path]) -> None:
    """Check that a file or folder of tracks is none of the named inputs.

    Raises:
        DataError: if it is one.
    """
    for name, path in inputs.items():
        if out.resolve() == path.resolve():
            raise DataError(f"{out}: the tracks would be written over {name}; choose another folder")


def kitti_folder(root: Path, out: Path | None) -> Path:
    """Return the folder for the tracks of a folder of KITTI sequences, by default `ROOT/tracks`.

    Raises:
        DataError: if it is one of the folders of the sequences, whose files have the same names.
    """
    folder = root / "tracks" if out is None else out
    check_apart(folder, {f"the files of '{own.name}'": own for own in input_folders(root)})
    return folder


def people_path(detections: Path, folder: Path) -> Path:
    """Return the path for the tracks of a MOTChallenge file: a file of the same name in a folder.

    Raises:
        DataError: if it is the file of the detections.
    """
    path = folder / f"{detections.stem}.txt"
    check_apart(path, {"the detections": detections})
    return path


def tracks_folder(root: Path, source: str, scene: str) -> Path:
    """Return the default folder for the tracks of a scene: `ROOT/tracks/SOURCE/SCENE`.

    If the source is a folder, its last part is used.

    Raises:
        DataError: if a name contains a path.
    """
    return root / "tracks" / plain_name(root, Path(source).absolute().name) / plain_name(root, scene)
