"""What every lens can do."""

from __future__ import annotations

from typing import Protocol

from appocc.checks import FloatArray


class Lens(Protocol):
    """A lens between the camera frame (x right, y down, z ahead) and pixels (u, v), centres at whole numbers."""

    def project(self, points_cam: FloatArray) -> FloatArray:
        """Return the pixels (N, 2) of points (N, 3); NaN for those that the lens does not see.

        A lens does not know the size of the picture: pixels beside it are returned, too.
        """
        ...

    def unproject(self, uv_px: FloatArray) -> FloatArray:
        """Return the unit rays (N, 3) that pixels (N, 2) see; NaN for pixels that see nothing."""
        ...
