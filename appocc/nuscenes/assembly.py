"""Datasets that are assembled from scenes: finished scenes are kept, and the same call resumes from them."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from uuid import uuid4

from appocc.errors import DataError
from appocc.files import RemotePath, read_json, whole_file, write_json
from appocc.files.transfer import send_folder, working_folder
from appocc.nuscenes.writer import Writer, is_sent_last
from appocc.temporary import locked, made_folder

_SCENES, _DATASET = "scenes", "dataset"
# Says that a part of the dataset is sent.
_SENDING = "sending"


@dataclass(frozen=True)
class Assembly:
    """The dataset `out`, made of scenes that are written one by one into a hidden folder next to it.

    For a remote `out`, that folder is on this machine, and the finished dataset is sent.

    Attributes:
        out: folder of the dataset, `resolved`.
        version: name of the folder of its tables; empty for results without tables.
        record: name of the JSON file in `out` that stores the settings.
        settings: JSON values that determine every byte of the dataset.
        what: noun for messages, such as simulation.
        work: the hidden folder of the unfinished dataset.
    """

    out: Path
    version: str
    record: str
    settings: Mapping[str, Any]
    what: str
    work: Path = field(init=False)

    def __post_init__(self) -> None:
        """Find the hidden folder, for workers on other machines too."""
        object.__setattr__(self, "work", unfinished_folder(self.out))

    def is_finished(self) -> bool:
        """Return whether `out` already is this dataset; remove what a run has left that was killed at its very end.

        Raises:
            DataError: if `out` holds anything else, or cannot be replaced by a finished dataset.
        """
        out = self.out
        if out.is_mount() or out.resolve() == Path.cwd():
            raise DataError(f"{out}: expected a new folder, got the working folder or a mounted disk; name one in it")
        if not out.exists() or (out.is_dir() and not any(out.iterdir())) or (self.work / _SENDING).is_file():
            return False
        if out.is_dir() and (out / self.record).is_file():
            if other := self._differences(read_json(out / self.record)):
                raise DataError(f"{out}: holds a {self.what} with other settings ({other}); name a new folder")
            shutil.rmtree(self.work, ignore_errors=True)
            return True
        raise DataError(f"{out}: exists already; name a new folder")

    @contextmanager
    def opened(self) -> Iterator[None]:
        """Lock the hidden folder; it keeps its finished scenes when the block is interrupted.

        Raises:
            DataError: if it belongs to other settings or to a running process, or cannot be written.
        """
        work = self.work
        try:
            with made_folder(work), locked(work / "lock", self.out):
                try:
                    self._check_settings()
                    yield
                finally:
                    for part in work.glob(f"{_SCENES}/*.part"):
                        shutil.rmtree(part, ignore_errors=True)
                    if not any(work.glob(f"{_SCENES}/*")):
                        shutil.rmtree(work, ignore_errors=True)
        except OSError as error:
            raise DataError(f"{error.filename or self.out}: cannot be written ({error.strerror or error})") from error

    def place(self, scene: str) -> Path:
        """Return the folder of a finished scene."""
        return self.work / _SCENES / scene

    def has(self, scene: str) -> bool:
        """Return whether a scene is finished."""
        return self.place(scene).is_dir()

    def write(self, scene: str, write: Callable[[Writer], None]) -> None:
        """Write a scene: `write` gets a writer for it, whose files and tables are kept if it succeeds.

        Raises:
            DataError: as `write` does, or if a file cannot be written.
        """

        def write_tables(part: Path) -> None:
            writer = Writer(part, self.version)
            write(writer)
            writer.save()

        self.write_files(scene, write_tables)

    def write_files(self, scene: str, write: Callable[[Path], None]) -> None:
        """Write the files of a scene: `write` gets a folder for them, to be made, which is kept if it succeeds.

        Raises:
            DataError: as `write` does.
        """
        place = self.place(scene)
        # A name of its own: on a cluster, a scene may be written twice, by a worker that was taken for dead.
        part = place.with_name(f"{scene}.{uuid4().hex}.part")
        try:
            write(part)
            part.replace(place)
        except OSError:
            if not place.is_dir():
                raise
        finally:
            shutil.rmtree(part, ignore_errors=True)

    def finish(self, scenes: Sequence[str], shared: Path | None = None) -> None:
        """Merge finished scenes into the dataset and move it to its folder; can be interrupted and repeated.

        Args:
            scenes: names of all scenes, in order.
            shared: folder of files that belong to several scenes.

        Raises:
            DataError: if a file cannot be read or written.
        """
        root = self.work / _DATASET
        for half in root.rglob(".*"):  # written by a run that was killed
            half.unlink()
        places = [self.place(scene) for scene in scenes]
        if self.version:
            merge_tables([place / self.version for place in places], root / self.version)
        for place in [*places, *([] if shared is None else [shared])]:
            _move_files(place, root, leave=self.version)
        write_json(root / self.record, dict(self.settings))
        if isinstance(self.out, RemotePath):
            (self.work / _SENDING).touch()
            send_folder(root, self.out, last=lambda path: is_sent_last(path) or path == root / self.record)
        else:
            if self.out.is_dir():
                self.out.rmdir()
            root.replace(self.out)
        shutil.rmtree(self.work, ignore_errors=True)

    def _check_settings(self) -> None:
        kept = self.work / self.record
        if kept.is_file() and (other := self._differences(read_json(kept))):
            if count_finished_scenes(self.out):
                raise DataError(
                    f"{self.work}: left by a run with other settings ({other}); resume with those, or remove it"
                )
            for path in self.work.iterdir():  # nothing is lost
                if path.is_dir():
                    shutil.rmtree(path, ignore_errors=True)
        write_json(kept, dict(self.settings))

    def _differences(self, kept: Any) -> str:
        """Return the names of the settings that differ from those stored in a file, empty if there are none."""
        asked = json.loads(json.dumps(dict(self.settings)))  # as they are after writing and reading
        if not isinstance(kept, dict):
            return "all"
        missing = object()
        names = (*asked, *(name for name in kept if name not in asked))
        return ", ".join(name for name in names if kept.get(name, missing) != asked.get(name, missing))


def resolved(out: Path) -> Path:
    """Resolve an output folder if it is a link or ends in dots."""
    return out.resolve() if out.is_symlink() or out.name in ("", "..") else out


def unfinished_folder(out: Path) -> Path:
    """Return the folder with the finished scenes of an interrupted run."""
    out = resolved(out)
    if isinstance(out, RemotePath):
        return working_folder(out)
    return out.parent / f".{out.name}.unfinished"


def count_finished_scenes(out: Path) -> int:
    """Return the number of scenes that an interrupted run has finished."""
    places = unfinished_folder(out).glob(f"{_SCENES}/*")
    return sum(place.suffix != ".part" for place in places)


def merge_tables(sources: Sequence[Path], target: Path) -> None:
    """Write the tables of several datasets as those of one; rows with a token that was there before are left out.

    The tables of one source are in memory at a time.

    Args:
        sources: folders of tables; the same row has the same token in all of them.
        target: folder of the merged tables.

    Raises:
        DataError: if a table cannot be read or written.
    """
    names = dict.fromkeys(path.name for source in sources for path in sorted(source.glob("*.json")))
    for name in names:
        with whole_file(target / name) as temporary, temporary.open("w", encoding="utf-8") as file:
            file.write("[")
            seen: set[str] = set()
            for source in sources:
                for row in read_json(source / name) if (source / name).is_file() else []:
                    if row["token"] not in seen:
                        file.write((",\n" if seen else "\n") + json.dumps(row, indent=0))
                        seen.add(row["token"])
            file.write("\n]\n" if seen else "]\n")


def _move_files(source: Path, target: Path, leave: str) -> None:
    """Move the files below one folder to the same paths below another, except hidden ones and the folder `leave`."""
    for path in sorted(path for path in source.rglob("*") if path.is_file()):
        place = path.relative_to(source)
        if place.parts[0] != leave and not path.name.startswith("."):
            (target / place).parent.mkdir(parents=True, exist_ok=True)
            path.replace(target / place)
