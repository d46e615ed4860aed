"""Tables of a dataset root, read on demand, and the indexes between them."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path

import numpy as np

from appocc.checks import IntArray
from appocc.errors import DataError, NotFoundError
from appocc.files.questions import can_list, check_folder
from appocc.nuscenes.schema import EXTRA_TABLES, LABEL_TABLES, OPTIONAL_TABLES, TABLES
from appocc.nuscenes.table import RowGroups, Table, empty_table, read_table, take_rows

# Names that are tried where folders cannot be listed.
_USUAL_VERSIONS = ("v1.0-trainval", "v1.0-mini", "v1.0-test", "v1.0-simulation", "v1.0-own", "v1.0-pandaset")


def find_version(root: Path, version: str | None) -> str:
    """Return the name of the folder of the tables below `root`; '' if the tables are in the root itself.

    Raises:
        DataError: if there is none, or there are several and `version` is None.
    """
    check_folder(root)
    if can_list(root):
        found = sorted(path.parent.name for path in root.glob("*/sample_data.json"))
    else:
        tried = _USUAL_VERSIONS if version is None else (version,)
        found = [name for name in tried if (root / name / "sample_data.json").is_file()]
    if (root / "sample_data.json").is_file():
        found.insert(0, "")
    if version is not None:
        if version not in found:
            raise DataError(f"{root}: no version '{version}'; found {', '.join(found) or 'none'}")
        return version
    if not found:
        unlisted = "" if can_list(root) else "; a web server has no list of its files: name theirs with --version"
        raise DataError(
            f"{root}: no nuScenes-schema dataset (expected tables such as v1.0-*/sample_data.json{unlisted})"
        )
    if len(found) > 1:
        raise DataError(f"{root}: several versions ({', '.join(found)}); choose one with --version")
    return found[0]


class Tables:
    """Tables and the indexes between them; each is read when first used."""

    def __init__(self, root: Path, version: str | None = None) -> None:
        """Find the tables of `root`.

        Raises:
            DataError: if there are none, or several versions and `version` is None.
        """
        self.root = root
        self.version = find_version(root, version)
        self.folder = root / self.version
        self._loaded: dict[str, Table] = {}

    def __getitem__(self, name: str) -> Table:
        """Return a table by name; a missing optional table is empty.

        Raises:
            NotFoundError: if the schema has no such table.
            DataError: if its file is missing or damaged.
        """
        fields = TABLES.get(name) or EXTRA_TABLES.get(name)
        if fields is None:
            raise NotFoundError(f"the schema has no table '{name}'; it has {', '.join([*TABLES, *EXTRA_TABLES])}")
        if name not in self._loaded:
            missing = name in OPTIONAL_TABLES and not self.path(name).exists()
            self._loaded[name] = empty_table(name, fields) if missing else read_table(self.path(name), fields)
        return self._loaded[name]

    def path(self, name: str) -> Path:
        """Return the path of a table."""
        return self.folder / f"{name}.json"

    def load_all(self) -> None:
        """Read all tables and build all indexes now.

        Raises:
            DataError: if a file is missing or damaged.
        """
        for name in TABLES:
            self[name].rows_of(np.array([b""]))
        _ = self.data_by_sample, self.annotations_by_sample, self.data_channel

    @cached_property
    def data_by_sample(self) -> RowGroups:
        """Rows of sample_data by sample token."""
        return self["sample_data"].groups("sample_token")

    @cached_property
    def annotations_by_sample(self) -> RowGroups:
        """Rows of sample_annotation by sample token."""
        return self["sample_annotation"].groups("sample_token")

    @cached_property
    def zones_by_sample(self) -> RowGroups:
        """Rows of nolabelzone by sample token."""
        return self["nolabelzone"].groups("sample_token")

    @cached_property
    def labels_by_data(self) -> dict[str, RowGroups]:
        """Rows of each table of label files by sample_data token."""
        return {name: self[name].groups("sample_data_token") for name in LABEL_TABLES}

    @cached_property
    def samples_by_scene(self) -> RowGroups:
        """Rows of sample by scene token."""
        return self["sample"].groups("scene_token")

    @cached_property
    def data_calibration(self) -> IntArray:
        """(N,) row of calibrated_sensor for each row of sample_data, -1 if the reference is broken."""
        return self["calibrated_sensor"].rows_of(self["sample_data"].array("calibrated_sensor_token"))

    @cached_property
    def data_channel(self) -> IntArray:
        """(N,) row of sensor for each row of sample_data, -1 if a reference is broken."""
        sensor = self["sensor"].rows_of(self["calibrated_sensor"].array("sensor_token"))
        return take_rows(sensor, self.data_calibration)

    @cached_property
    def annotation_category(self) -> IntArray:
        """(N,) row of category for each row of sample_annotation, -1 if a reference is broken."""
        instance = self["instance"].rows_of(self["sample_annotation"].array("instance_token"))
        category = self["category"].rows_of(self["instance"].array("category_token"))
        return take_rows(category, instance)
