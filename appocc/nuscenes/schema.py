"""The tables of the nuScenes schema, their fields, and how each field is kept in memory."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Kind = Literal["token", "text", "name", "tokens", "int", "time", "bool", "vector", "any"]


@dataclass(frozen=True)
class Field:
    """A field of a table.

    Attributes:
        name: key in the JSON objects.
        kind: token and text become numpy byte strings, int int64, bool bool, vector float64 (N, width); time becomes
            int64 microseconds, fractions cut off; name becomes a list of str, tokens a list of tuples of str, any a
            list of whatever the file holds.
        refers_to: table whose tokens the field holds, if it is a reference.
        width: length of a vector.
        required: whether every record must have it, and not null (but for tokens and parts of vectors); others get a
            default (empty, `unknown`, False). A required name must not be empty.
        optional_reference: whether an empty reference is allowed (ends of chains, unknown visibility).
        unknown: what an int is where it is missing or null.
        choices: all that a name can be; empty where it can be anything.
    """

    name: str
    kind: Kind
    refers_to: str = ""
    width: int = 0
    required: bool = True
    optional_reference: bool = False
    unknown: int = 0
    choices: tuple[str, ...] = ()


def _ref(name: str, table: str, optional: bool = False) -> Field:
    return Field(name, "token", table, optional_reference=optional)


_TOKEN = Field("token", "token")

TABLES: dict[str, tuple[Field, ...]] = {
    "attribute": (_TOKEN, Field("name", "name"), Field("description", "name", required=False)),
    "calibrated_sensor": (
        _TOKEN,
        _ref("sensor_token", "sensor"),
        Field("translation", "vector", width=3),
        Field("rotation", "vector", width=4),
        Field("camera_intrinsic", "any"),
    ),
    "category": (
        _TOKEN,
        Field("name", "name"),
        Field("description", "name", required=False),
        Field("index", "any", required=False),  # the label of the category in nuScenes-lidarseg
    ),
    "ego_pose": (
        _TOKEN,
        Field("timestamp", "time"),
        Field("translation", "vector", width=3),
        Field("rotation", "vector", width=4),
    ),
    "instance": (
        _TOKEN,
        _ref("category_token", "category"),
        Field("nbr_annotations", "int", required=False, unknown=-1),
        _ref("first_annotation_token", "sample_annotation"),
        _ref("last_annotation_token", "sample_annotation"),
    ),
    "log": (
        _TOKEN,
        Field("logfile", "name", required=False),
        Field("vehicle", "name", required=False),
        Field("date_captured", "name", required=False),
        Field("location", "name", required=False),
    ),
    "map": (
        _TOKEN,
        Field("category", "name", required=False),
        Field("filename", "name"),
        Field("log_tokens", "tokens", "log"),
        Field("origin_m", "any", required=False),
        Field("unknown_value", "any", required=False),
        Field("source", "name", required=False),
    ),
    "sample": (
        _TOKEN,
        Field("timestamp", "time"),
        _ref("scene_token", "scene"),
        _ref("prev", "sample", optional=True),
        _ref("next", "sample", optional=True),
    ),
    "sample_annotation": (
        _TOKEN,
        _ref("sample_token", "sample"),
        _ref("instance_token", "instance"),
        _ref("visibility_token", "visibility", optional=True),
        Field("attribute_tokens", "tokens", "attribute", required=False),
        Field("translation", "vector", width=3),
        Field("size", "vector", width=3),
        Field("rotation", "vector", width=4),
        _ref("prev", "sample_annotation", optional=True),
        _ref("next", "sample_annotation", optional=True),
        Field("num_lidar_pts", "int", required=False, unknown=-1),
        Field("num_radar_pts", "int", required=False, unknown=-1),
    ),
    "sample_data": (
        _TOKEN,
        _ref("sample_token", "sample"),
        _ref("ego_pose_token", "ego_pose"),
        _ref("calibrated_sensor_token", "calibrated_sensor"),
        Field("timestamp", "time"),
        Field("fileformat", "text", required=False),
        Field("is_key_frame", "bool"),
        Field("height", "int", required=False),
        Field("width", "int", required=False),
        Field("filename", "text"),
        _ref("prev", "sample_data", optional=True),
        _ref("next", "sample_data", optional=True),
    ),
    "scene": (
        _TOKEN,
        _ref("log_token", "log"),
        Field("nbr_samples", "int", required=False, unknown=-1),
        _ref("first_sample_token", "sample"),
        _ref("last_sample_token", "sample"),
        Field("name", "name"),
        Field("description", "name", required=False),
    ),
    "sensor": (_TOKEN, Field("channel", "name"), Field("modality", "name", choices=("camera", "lidar", "radar"))),
    "visibility": (_TOKEN, Field("level", "name", required=False), Field("description", "name", required=False)),
}

# Tables beside the thirteen, read only where they are asked for.
_LABEL_FILES = (_TOKEN, _ref("sample_data_token", "sample_data"), Field("filename", "text"))
EXTRA_TABLES: dict[str, tuple[Field, ...]] = {
    "lidarseg": _LABEL_FILES,
    "pointlabels": _LABEL_FILES,
    "pointlabels_category": (_TOKEN, Field("name", "name"), Field("index", "any", required=False)),
    # True paints of simulated vehicles: sRGB 0..255 and the colour's name.
    "paint": (_TOKEN, _ref("instance_token", "instance"), Field("rgb", "vector", width=3), Field("name", "name")),
}
# Tables of label files of LiDAR points, the finest first (nuScenes-lidarseg knows no lane markings), and for each
# the table that names its labels by `index`.
LABEL_TABLES = {"pointlabels": "pointlabels_category", "lidarseg": "category"}

# Tables that a recording without boxes or maps may lack; they count as empty.
OPTIONAL_TABLES = frozenset(
    {"attribute", "category", "instance", "map", "sample_annotation", "visibility", *EXTRA_TABLES}
)
