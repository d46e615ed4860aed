"""Sources of towns: built in, imported from a map file, or generated from a seed."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from appocc.errors import DataError, NotFoundError
from appocc.files import digest_of
from appocc.simulation.builtin import TEST_TOWNS, TRAIN_TOWNS, load_builtin
from appocc.simulation.plan import TownPlan
from appocc.simulation.town_files import load_town
from appocc.simulation.traffic import TrafficLog

SPLITS = {"train": TRAIN_TOWNS, "test": TEST_TOWNS, "all": (*TRAIN_TOWNS, *TEST_TOWNS)}
_RANDOM = re.compile(r"random:(\d{1,9})")
_MAPS = (".xodr", ".net.xml", ".net.xml.gz")


@dataclass(frozen=True)
class TownSource:
    """A town before it is loaded.

    Attributes:
        name: of the town.
        origin: None for a built-in town, else the map file or the seed.
        digest: of the map file's bytes.
    """

    name: str
    origin: Path | int | None = None
    digest: str = ""

    def as_json(self) -> dict[str, Any]:
        """Return JSON values that identify the town, independent of the path of its file."""
        seed = {"seed": self.origin} if isinstance(self.origin, int) else {}
        return {"name": self.name, **seed, **({"sha256": self.digest} if self.digest else {})}

    def is_prepared(self, folder: Path) -> bool:
        """Return whether it can be loaded: built in, or its files (the plan is written last) are in `folder`."""
        return self.origin is None or (folder / f"{self.name}.plan.json").is_file()

    def prepare(self, folder: Path) -> None:
        """Generate the town's files in `folder` if they do not exist; needs the extra `sumo`.

        Raises:
            AppoccError: if the extra is not installed.
            DataError: if the map file is damaged or holds no streets.
        """
        if self.origin is None or self.is_prepared(folder):
            return
        from appocc.simulation.town_generation.make import generate_town

        folder.mkdir(parents=True, exist_ok=True)
        generate_town(self.origin, folder, self.name)

    def load(self, folder: Path) -> tuple[TownPlan, TrafficLog]:
        """Load plan and traffic; towns that are not built in must be prepared in `folder`."""
        return _load(self.name, None if self.origin is None else folder)


@lru_cache(maxsize=16)
def _load(name: str, folder: Path | None) -> tuple[TownPlan, TrafficLog]:
    return load_builtin(name) if folder is None else load_town(folder, name)


def town_sources(split: str, asked: Sequence[str]) -> tuple[TownSource, ...]:
    """Return the towns of a split, or those named: built-in names, map files, `random:SEED`.

    Raises:
        NotFoundError: if a name is neither a known town nor a file.
        DataError: if a file is not a map or cannot be read, or two towns have the same name.
    """
    found = tuple(_source(text) for text in asked) if asked else tuple(TownSource(name) for name in SPLITS[split])
    names = [source.name for source in found]
    if len(set(names)) < len(names):
        raise DataError(f"towns: expected different names, got {', '.join(names)}")
    return found


def _source(text: str) -> TownSource:
    if text in SPLITS["all"]:
        return TownSource(text)
    random_town = _RANDOM.fullmatch(text)
    if random_town:
        return TownSource(f"random-{int(random_town[1])}", int(random_town[1]))
    path = Path(text)
    if not path.is_file():
        names = ", ".join(SPLITS["all"])
        raise NotFoundError(f"{text}: no built-in town ({names}), no map file, and not random:SEED")
    if not text.endswith(_MAPS):
        raise DataError(f"{text}: expected an OpenDRIVE (.xodr) or SUMO (.net.xml, .net.xml.gz) map")
    return TownSource(path.name.split(".")[0], path, digest_of(path))
