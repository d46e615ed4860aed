"""The opened roots and the recordings in them."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from pathlib import Path
from threading import Lock
from typing import NamedTuple

from appocc.errors import AppoccError, DataError, NotFoundError
from appocc.files.questions import folders_in
from appocc.models.shipped import PACKAGED, shipped_weights
from cli.server.recording import Recording

# Levels of folders below a root that are searched for datasets, and the most folders that are looked at.
_DEPTH, _MOST_FOLDERS = 3, 2000
_TABLE = "sample_data.json"
# A folder of a training has its metrics.
_METRICS, _CURVES = "metrics.jsonl", "curves.png"


class WeightsChoice(NamedTuple):
    """Weights with which the page predicts maps.

    Attributes:
        path: the file.
        source: the source of its maps, unlike that of true maps.
    """

    path: Path
    source: str


class Library:
    """The recordings below the opened roots; no other file is read."""

    def __init__(self, roots: Sequence[Path]) -> None:
        """Open the roots: datasets, folders of datasets, or empty folders for new drives.

        Raises:
            DataError: if a root is no folder, is not empty and has no dataset, or its tables are damaged.
        """
        self.roots = tuple(dict.fromkeys(root.resolve() for root in roots))
        self._lock = Lock()
        self._known: dict[str, Recording] = {}
        for given, root in zip(roots, (root.resolve() for root in roots), strict=True):
            if not root.is_dir():
                got = "a file" if root.exists() else "no such folder"
                raise DataError(f"{given}: expected a dataset or a folder of datasets, got {got}")
            empty = not any(root.iterdir())
            if not (empty or any(_datasets(root)) or any(_trainings(root))):
                raise DataError(
                    f"{given}: no nuScenes-schema dataset in it (expected tables such as v1.0-*/{_TABLE})"
                )
        self.refresh()
        for recording in self.recordings():
            if recording.root in self.roots:
                for scene in range(len(recording.scenes)):  # so that damage is an error now, and not in the page
                    recording.samples(scene)

    @property
    def new_drives(self) -> Path | None:
        """Folder for simulated drives: the first root that is neither a dataset nor a training; None without one."""
        folders = (root for root in self.roots if not _versions(root) and not (root / _METRICS).is_file())
        return next(folders, None)

    def refresh(self) -> None:
        """Look for new datasets below the roots."""
        found = [(top, root, version) for top in self.roots for root, version in _datasets(top)]
        with self._lock:
            for top, root, version in found:
                key = hashlib.sha256(f"{root}\0{version}".encode()).hexdigest()[:10]
                if key not in self._known:
                    self._known[key] = Recording(key, _title(top, root, version), root, version)
            there = {(root, version) for _, root, version in found}
            self._known = {key: one for key, one in self._known.items() if (one.root, one.version) in there}

    def recordings(self) -> list[Recording]:
        """Return the recordings in the order of the roots."""
        with self._lock:
            return list(self._known.values())

    def trainings(self) -> dict[str, Path]:
        """Return the pictures of the curves of the trainings below the roots, by name; they may not exist yet."""
        found = [(top, folder) for top in self.roots for folder in _trainings(top)]
        return {str(Path(top.name) / folder.relative_to(top)): folder / _CURVES for top, folder in found}

    def weights(self) -> dict[str, WeightsChoice]:
        """Return the weights by name, the default ones first: those shipped, and the files below the roots."""
        shipped = sorted(shipped_weights().items(), key=lambda item: (item[1] != PACKAGED, item[0]))
        found = {name: WeightsChoice(path, _source_of(name, path)) for name, path in shipped}
        for top in self.roots:
            for folder in _walk(top):
                for path in sorted(folder.glob("*.safetensors")):
                    below = path.relative_to(top)
                    source = _source_of("-".join(below.with_suffix("").parts), path)
                    found[str(Path(top.name) / below)] = WeightsChoice(path, source)
        return found

    def recording(self, key: str) -> Recording:
        """Return a recording by its key.

        Raises:
            NotFoundError: if there is none.
        """
        with self._lock:
            found = self._known.get(key)
        if found is None:
            raise NotFoundError("this recording is not open here")
        return found


def _source_of(name: str, path: Path) -> str:
    """Return the source of the maps of weights: `predicted` for the default ones, as in the documents."""
    return "predicted" if path == PACKAGED else f"predicted-{name}"


def describe(recording: Recording) -> dict[str, object]:
    """Return what the page lists of a recording; a damaged one has an error."""
    about: dict[str, object] = {"key": recording.key, "title": recording.title, "error": None}
    try:
        scenes = [
            {"name": scene.name, "description": scene.description, "frames": len(recording.samples(index))}
            for index, scene in enumerate(recording.scenes)
        ]
        return {**about, "scenes": scenes, "sources": recording.sources(), "truth": recording.truth()}
    except AppoccError as error:
        return {**about, "scenes": [], "sources": [], "truth": None, "error": str(error)}


def _title(top: Path, root: Path, version: str) -> str:
    """Return the name of a recording for people: its path from the opened root's own name on."""
    name = str(Path(top.name) / root.relative_to(top))
    return f"{name} ({version})" if len(_versions(root)) > 1 else name


def _versions(root: Path) -> list[str]:
    """Return the folders of tables of a dataset; '' for the root itself; empty if it is no dataset."""
    own = [""] if (root / _TABLE).is_file() else []
    return own + sorted(path.parent.name for path in root.glob(f"*/{_TABLE}"))


def _datasets(top: Path) -> Iterator[tuple[Path, str]]:
    """Yield the datasets at or below a folder, with each version."""
    return ((folder, version) for folder in _walk(top) for version in _versions(folder))


def _trainings(top: Path) -> Iterator[Path]:
    """Yield the folders of trainings at or below a folder."""
    return (folder for folder in _walk(top) if (folder / _METRICS).is_file())


def _walk(top: Path) -> Iterator[Path]:
    """Yield a folder and those below it, but none inside of datasets; hidden folders and links are left out."""
    level, looked = [top], 0
    for _ in range(_DEPTH + 1):
        below: list[Path] = []
        for folder in level:
            looked += 1
            if looked > _MOST_FOLDERS:
                return
            yield folder
            if not _versions(folder):
                below += folders_in(folder)
        level = below
