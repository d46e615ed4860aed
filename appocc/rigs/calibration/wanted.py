"""Request of a rig file for one camera of a calibration file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from appocc.checks import FloatArray
from appocc.errors import DataError


class Wanted(NamedTuple):
    """What a rig file asks of a calibration file.

    Attributes:
        path: the file.
        camera: name of the camera in it; None if the rig file names none.
        model: pinhole or fisheye, for files that do not tell; None if the rig file does not tell.
        bases: (4, 4) poses in the ego frame of what the file's poses relate to, by key.
    """

    path: Path
    camera: str | None
    model: str | None
    bases: Mapping[str, FloatArray]

    def choose(self, names: Sequence[str]) -> str:
        """Return the name of the camera that is asked for, out of those of the file.

        Raises:
            DataError: if there is no such camera, or there are several and none is asked for.
        """
        if self.camera is None and len(names) == 1:
            return names[0]
        if self.camera is None or self.camera not in names:
            asked = "several" if self.camera is None else f"'{self.camera}'"
            example = f"calibration: {{file: {self.path.name}, camera: {names[0]}}}" if names else "one camera"
            raise DataError(f"{self.path}: expected a camera of {', '.join(names)}, got {asked}; such as {example}")
        return self.camera

    def refuse_poses(self) -> None:
        """Check that no pose of a base is asked for, in a file that has no poses.

        Raises:
            DataError: if one is.
        """
        if self.bases:
            raise DataError(f"{self.path}: expected poses for {next(iter(self.bases))}, got a file that has none")
