"""Rows of the ablation study, the most important first."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

from appocc.errors import DataError
from appocc.models.registry import COLOURINGS
from appocc.training.config import Config

# Outputs of a network.
OCCUPANCY, BOTH, COLOUR = "occupancy", "both", "colour"


class StudyRow(NamedTuple):
    """One training and its evaluation.

    Attributes:
        network: name of a network in the registry, or of a colouring method without learning.
        setting: 360 or 180.
        outputs: OCCUPANCY, BOTH (with appearance) or COLOUR.
        seed: training seed; None without learning.
        parts: optional parts of the network.
    """

    network: str
    setting: str
    outputs: str
    seed: int | None
    parts: tuple[str, ...] = ()

    @property
    def label(self) -> str:
        """Name of the network with its parts, such as appocc+depth."""
        return "+".join((self.network, *self.parts))

    @property
    def name(self) -> str:
        """Name of the row and of its folder."""
        words = (self.label, self.setting, self.outputs, *(() if self.seed is None else (f"s{self.seed}",)))
        return "-".join(words)

    @property
    def learns(self) -> bool:
        """Whether the row has a network to train."""
        return self.network not in COLOURINGS

    def config(self, base: Config) -> Config:
        """Return the training configuration of the row: `base` with the values of the row."""
        train = base.train if self.seed is None else base.train.model_copy(update={"seed": self.seed})
        own = {"network": self.network, "setting": self.setting, "appearance": self.outputs == BOTH, "train": train}
        return base.model_copy(update={**own, "parts": self.parts})


# Networks with one seed, after the default network; NEAT is the paper's baseline in the 180 degree setting.
_OTHERS = (
    ("lss", "360", OCCUPANCY),
    ("lss", "180", OCCUPANCY),
    ("ipm", "360", COLOUR),
    ("ipm", "180", COLOUR),
    ("paper", "360", BOTH),
    ("paper", "360", OCCUPANCY),
    ("paper", "180", BOTH),
    ("paper", "180", OCCUPANCY),
    ("neat", "180", OCCUPANCY),
    ("neat", "360", OCCUPANCY),
)

# Parts of the default network, one after the other.
_PARTS = (("depth",), ("depth", "memory"), ("depth", "objects"), ("depth", "memory", "objects"))


def study_rows(first_seed: int, seeds: int) -> tuple[StudyRow, ...]:
    """Return all rows: every network with the first seed, then the default network with the other seeds.

    A study that ends early then has complete tables with fewer seeds.
    """
    default = [("appocc", setting, answers) for setting in ("360", "180") for answers in (OCCUPANCY, BOTH)]
    rows = [StudyRow(*parts, None if parts[0] in COLOURINGS else first_seed) for parts in (*default, *_OTHERS)]
    rows += [StudyRow("appocc", "360", BOTH, first_seed, parts) for parts in _PARTS]
    for seed in range(first_seed + 1, first_seed + seeds):
        rows += [StudyRow(*parts, seed) for parts in default]
        rows += [StudyRow("appocc", "360", BOTH, seed, parts) for parts in _PARTS]
    return tuple(rows)


def chosen_rows(rows: Sequence[StudyRow], pattern: str | None) -> tuple[StudyRow, ...]:
    """Return the rows whose name contains a regular expression; all rows without one.

    Raises:
        DataError: if it is invalid or matches no row.
    """
    try:
        found = tuple(row for row in rows if re.search(pattern or "", row.name))
    except re.error as error:
        raise DataError(f"'{pattern}': expected a regular expression ({error})") from error
    if not found:
        raise DataError(f"'{pattern}': expected part of a row's name, of {', '.join(row.name for row in rows)}")
    return found
