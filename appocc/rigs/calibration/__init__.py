"""Calibration files of other tools, as keys of a camera in a rig file.

Read are Kalibr's camera chains, OpenCV's FileStorage and ROS' camera_info (both YAML), COLMAP's cameras.txt,
OCamCalib's calib_results.txt, and WoodScape's JSON. What a file is, is told by its content.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from appocc.errors import DataError
from appocc.files import read_text
from appocc.rigs.calibration import colmap, kalibr, matrices, scaramuzza, woodscape
from appocc.rigs.calibration.wanted import Wanted
from appocc.rigs.fields import Fields
from appocc.rigs.poses import read_transform
from appocc.xml_file import parse_xml
from appocc.yaml_file import parse_yaml, plain_yaml

_KEYS = ("file", "camera", "model", "circle_deg", *kalibr.BASES)
_EXAMPLE = "front.yaml, or {file: camchain.yaml, camera: cam0}"
_MOST_BYTES, _SHOWN = 500_000, 80
_FORMATS = (
    "Kalibr's camchain, OpenCV's FileStorage, ROS' camera_info, COLMAP's cameras.txt, OCamCalib's calib_results.txt "
    "or WoodScape's JSON"
)
_READERS: tuple[tuple[Callable[[Any], bool], Callable[[Any, Wanted], dict[str, Any]]], ...] = (
    (kalibr.is_chain, kalibr.camera_keys),
    (woodscape.is_camera, woodscape.camera_keys),
    (matrices.is_camera, matrices.camera_keys),
)


def read_calibration(fields: Fields, folder: Path) -> dict[str, Any]:
    """Return the keys of a camera, as in a rig file, of the calibration file that its key `calibration` names.

    Args:
        fields: the camera's keys.
        folder: folder of the rig file, from which the name of the calibration file leads.

    Raises:
        DataError: if the file is missing, damaged, of no known format, or has no such camera or lens.
    """
    if isinstance(fields["calibration"], str):
        fields = fields.having(calibration={"file": fields["calibration"]})
    asked = fields.inside("calibration", _KEYS, _EXAMPLE)
    path = folder / asked.text("file")
    bases = {base: read_transform(asked, base) for base in kalibr.BASES if base in asked}
    model = asked.text("model", ("pinhole", "fisheye")) if "model" in asked else None
    camera = str(asked["camera"]) if "camera" in asked else None
    found = _keys_of(path, Wanted(path, camera, model, bases))
    if "circle_deg" in asked:
        if "fisheye" not in found:
            raise asked.refusal("circle_deg", "nothing for a lens that is no fisheye")
        found["fisheye"] = {**found["fisheye"], "circle_deg": asked["circle_deg"]}
    return found


def _keys_of(path: Path, wanted: Wanted) -> dict[str, Any]:
    text = read_text(path, _MOST_BYTES)
    colmap.refuse_images(text, path)
    if colmap.is_list(text):
        return colmap.camera_keys(text, wanted)
    if scaramuzza.is_camera(text):
        return scaramuzza.camera_keys(text, wanted)
    if text.lstrip().startswith("<"):
        values: Any = matrices.xml_values(parse_xml(path, text))
    else:
        try:
            values = parse_yaml(plain_yaml(text))
        except ValueError as error:
            raise DataError(f"{path}: expected {_FORMATS}, got no valid YAML ({error})") from error
    for fits, read in _READERS:
        if fits(values):
            return read(values, wanted)
    keys = f" with the keys {', '.join(map(str, values))[:_SHOWN]}" if isinstance(values, dict) else ""
    raise DataError(f"{path}: expected {_FORMATS}, got something else{keys}")
