"""Rig files of a single camera, as texts."""

from __future__ import annotations

from pathlib import Path

from appocc.rigs import SourceRig, read_source_rig

AHEAD = "position_m: [1.7, 0, 1.5]\n    yaw_deg: 0"
# 190 degrees wide, as each is at the edges of the middle row.
FISHEYE = "size_px: [320, 240]\n    fov_deg: 190\n    fisheye: [0.02, -0.005, 0.001, -0.0002]"
DISTORTED = "size_px: [320, 180]\n    fov_deg: 70\n    distortion: [-0.32, 0.12, 0.001, -0.001, -0.02]"
PINHOLE = "size_px: [320, 180]\n    fov_deg: 70"


def read_one(folder: Path, *keys: str, name: str = "front") -> SourceRig:
    """Return the rig of a file with one camera of these keys."""
    path = folder / "rig.yaml"
    path.write_text(f"cameras:\n  {name}:\n" + "".join(f"    {key}\n" for key in keys))
    return read_source_rig(path)
