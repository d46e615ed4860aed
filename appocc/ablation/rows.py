"""What is compared: the rows of the study, the most telling first."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

from appocc.errors import DataError
from appocc.models.registry import COLOURINGS
from appocc.training.config import Config

# What a row's network answers.
OCCUPANCY, BOTH, COLOUR = "occupancy", "both", "colour"


class Row(NamedTuple):
    """One training and its judgement.

    Attributes:
        network: a name of the registry, or of a colouring that learns nothing.
        setting: 360 or 180.
        answers: OCCUPANCY, BOTH (with appearance) or COLOUR.
        seed: of the training; None where nothing is learnt.
    """

    network: str
    setting: str
    answers: str
    seed: int | None

    @property
    def name(self) -> str:
        """Of its folder."""
        words = (self.network, self.setting, self.answers, *(() if self.seed is None else (f"s{self.seed}",)))
        return "-".join(words)

    @property
    def learns(self) -> bool:
        """Whether there is anything to train."""
        return self.network not in COLOURINGS

    def config(self, base: Config) -> Config:
        """The training of the row: `base` in all but what the row says."""
        train = base.train if self.seed is None else base.train.model_copy(update={"seed": self.seed})
        own = {"network": self.network, "setting": self.setting, "appearance": self.answers == BOTH, "train": train}
        return base.model_copy(update=own)


# Networks of one seed, after the default one; NEAT is the paper's rival in the 180 degree setting.
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


def study_rows(first_seed: int, seeds: int) -> tuple[Row, ...]:
    """All rows: every network with the first seed, then the default network with the others.

    An early end so leaves whole tables, with fewer seeds.
    """
    default = [("appocc", setting, answers) for setting in ("360", "180") for answers in (OCCUPANCY, BOTH)]
    rows = [Row(*parts, None if parts[0] in COLOURINGS else first_seed) for parts in (*default, *_OTHERS)]
    rows += [Row(*parts, first_seed + number) for number in range(1, seeds) for parts in default]
    return tuple(rows)


def chosen_rows(rows: Sequence[Row], pattern: str | None) -> tuple[Row, ...]:
    """The rows in whose names a regular expression is found; all without one.

    Raises:
        DataError: if it is none, or is found nowhere.
    """
    try:
        found = tuple(row for row in rows if re.search(pattern or "", row.name))
    except re.error as error:
        raise DataError(f"'{pattern}': expected a regular expression ({error})") from error
    if not found:
        raise DataError(f"'{pattern}': expected part of a row's name, of {', '.join(row.name for row in rows)}")
    return found
