"""Tables and fields of the nuScenes schema, with the type of each field in memory."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass
from typing import Literal

FieldKind = Literal["token", "text", "name", "tokens", "int", "time", "bool", "vector", "any"]


@dataclass(frozen=True)
class FieldSpec:
    """A field of a table.

    Attributes:
        name: key in the JSON objects.
        kind: token and text are numpy byte strings, int is int64, bool is bool, vector is float64 (N, width), time
            is int64 microseconds (fractions truncated), name is a list of str, tokens a list of tuples of str, any a
            list of JSON values.
        refers_to: table that a reference points to.
        width: length of a vector.
        required: whether every record must have the field, not null (except tokens and parts of vectors); other
            fields have a default (empty, `unknown`, False). A required name must not be empty.
        optional_reference: whether an empty reference is allowed (ends of chains, unknown visibility).
        unknown: default of an int field.
        choices: allowed names; empty: any name.
    """

    name: str
    kind: FieldKind
    refers_to: str = ""
    _: KW_ONLY
    width: int = 0
    required: bool = True
    optional_reference: bool = False
    unknown: int = 0
    choices: tuple[str, ...] = ()


def _ref(name: str, table: str, optional: bool = False) -> FieldSpec:
    return FieldSpec(name, "token", table, optional_reference=optional)


_TOKEN = FieldSpec("token", "token")

TABLES: dict[str, tuple[FieldSpec, ...]] = {
    "attribute": (_TOKEN, FieldSpec("name", "name"), FieldSpec("description", "name", required=False)),
    "calibrated_sensor": (
        _TOKEN,
        _ref("sensor_token", "sensor"),
        FieldSpec("translation", "vector", width=3),
        FieldSpec("rotation", "vector", width=4),
        FieldSpec("camera_intrinsic", "any"),
    ),
    "category": (
        _TOKEN,
        FieldSpec("name", "name"),
        FieldSpec("description", "name", required=False),
        FieldSpec("index", "any", required=False),  # label of the category in nuScenes-lidarseg
    ),
    "ego_pose": (
        _TOKEN,
        FieldSpec("timestamp", "time"),
        FieldSpec("translation", "vector", width=3),
        FieldSpec("rotation", "vector", width=4),
    ),
    "instance": (
        _TOKEN,
        _ref("category_token", "category"),
        FieldSpec("nbr_annotations", "int", required=False, unknown=-1),
        _ref("first_annotation_token", "sample_annotation"),
        _ref("last_annotation_token", "sample_annotation"),
    ),
    "log": (
        _TOKEN,
        FieldSpec("logfile", "name", required=False),
        FieldSpec("vehicle", "name", required=False),
        FieldSpec("date_captured", "name", required=False),
        FieldSpec("location", "name", required=False),
    ),
    "map": (
        _TOKEN,
        FieldSpec("category", "name", required=False),
        FieldSpec("filename", "name"),
        FieldSpec("log_tokens", "tokens", "log"),
        FieldSpec("origin_m", "any", required=False),
        FieldSpec("unknown_value", "any", required=False),
        FieldSpec("source", "name", required=False),
    ),
    "sample": (
        _TOKEN,
        FieldSpec("timestamp", "time"),
        _ref("scene_token", "scene"),
        _ref("prev", "sample", optional=True),
        _ref("next", "sample", optional=True),
    ),
    "sample_annotation": (
        _TOKEN,
        _ref("sample_token", "sample"),
        _ref("instance_token", "instance"),
        _ref("visibility_token", "visibility", optional=True),
        FieldSpec("attribute_tokens", "tokens", "attribute", required=False),
        FieldSpec("translation", "vector", width=3),
        FieldSpec("size", "vector", width=3),
        FieldSpec("rotation", "vector", width=4),
        _ref("prev", "sample_annotation", optional=True),
        _ref("next", "sample_annotation", optional=True),
        FieldSpec("num_lidar_pts", "int", required=False, unknown=-1),
        FieldSpec("num_radar_pts", "int", required=False, unknown=-1),
    ),
    "sample_data": (
        _TOKEN,
        _ref("sample_token", "sample"),
        _ref("ego_pose_token", "ego_pose"),
        _ref("calibrated_sensor_token", "calibrated_sensor"),
        FieldSpec("timestamp", "time"),
        FieldSpec("fileformat", "text", required=False),
        FieldSpec("is_key_frame", "bool"),
        FieldSpec("height", "int", required=False),
        FieldSpec("width", "int", required=False),
        FieldSpec("filename", "text"),
        _ref("prev", "sample_data", optional=True),
        _ref("next", "sample_data", optional=True),
    ),
    "scene": (
        _TOKEN,
        _ref("log_token", "log"),
        FieldSpec("nbr_samples", "int", required=False, unknown=-1),
        _ref("first_sample_token", "sample"),
        _ref("last_sample_token", "sample"),
        FieldSpec("name", "name"),
        FieldSpec("description", "name", required=False),
    ),
    "sensor": (
        _TOKEN,
        FieldSpec("channel", "name"),
        FieldSpec("modality", "name", choices=("camera", "lidar", "radar")),
    ),
    "visibility": (
        _TOKEN,
        FieldSpec("level", "name", required=False),
        FieldSpec("description", "name", required=False),
    ),
}

# Additional tables, read on request.
_LABEL_FILES = (_TOKEN, _ref("sample_data_token", "sample_data"), FieldSpec("filename", "text"))
EXTRA_TABLES: dict[str, tuple[FieldSpec, ...]] = {
    "lidarseg": _LABEL_FILES,
    "pointlabels": _LABEL_FILES,
    "pointlabels_category": (_TOKEN, FieldSpec("name", "name"), FieldSpec("index", "any", required=False)),
    # Places of a key frame in which nothing is annotated: outlines in the world frame, metres.
    "nolabelzone": (_TOKEN, _ref("sample_token", "sample"), FieldSpec("outline_m", "any")),
    # True paint of simulated vehicles: sRGB 0..255 and colour name.
    "paint": (
        _TOKEN,
        _ref("instance_token", "instance"),
        FieldSpec("rgb", "vector", width=3),
        FieldSpec("name", "name"),
    ),
}
# Tables of label files of LiDAR points, the finest first (nuScenes-lidarseg has no lane markings), with the table of
# their label names by `index`.
LABEL_TABLES = {"pointlabels": "pointlabels_category", "lidarseg": "category"}

# Tables that may be missing in a recording without boxes or maps; a missing table is empty.
OPTIONAL_TABLES = frozenset(
    {"attribute", "category", "instance", "map", "sample_annotation", "visibility", *EXTRA_TABLES}
)
