from __future__ import annotations

import pytest
from made_study import made_config

from appocc.ablation.rows import BOTH, COLOUR, OCCUPANCY, StudyRow, chosen_rows, study_rows
from appocc.errors import DataError
from appocc.models.registry import COLOURINGS, DEFAULT, NETWORKS

ROWS = study_rows(5, 3)


def test_every_network_has_its_rows_in_both_settings() -> None:
    assert {(row.network, row.setting) for row in ROWS} == {
        (name, setting) for name in (*NETWORKS, *COLOURINGS) for setting in ("360", "180")
    }
    for name, network in NETWORKS.items():
        wanted = {OCCUPANCY, BOTH} if network.appearance else {OCCUPANCY}
        assert {row.outputs for row in ROWS if row.network == name} == wanted
    assert {row.outputs for row in ROWS if not row.learns} == {COLOUR}
    assert len({row.name for row in ROWS}) == len(ROWS)


def test_the_first_seed_of_all_rows_precedes_the_second() -> None:
    seeds = [row.seed for row in ROWS if row.seed is not None]
    assert seeds == sorted(seeds)
    assert {row.network for row in ROWS if row.seed in (6, 7)} == {DEFAULT}
    # Two settings with two outputs each, and four choices of parts.
    assert sum(row.network == DEFAULT for row in ROWS) == 3 * (4 + 4)
    assert len(study_rows(0, 1)) == len(ROWS) - 2 * (4 + 4)


def test_parts_are_rows_of_the_default_network() -> None:
    names = [row.name for row in study_rows(0, 1) if row.parts]
    assert names[0] == "appocc+depth-360-both-s0"
    assert names[-1] == "appocc+depth+memory+objects-360-both-s0"
    config = StudyRow("appocc", "360", BOTH, 0, ("depth",)).config(made_config(parts=["objects"]))
    assert config.parts == ("depth",)
    assert StudyRow("lss", "360", OCCUPANCY, 0).config(config).parts == ()


def test_a_row_changes_its_own_keys_only() -> None:
    base = made_config(network="paper", setting=360, appearance=True)
    row = StudyRow("lss", "180", OCCUPANCY, 7)
    config = row.config(base)
    assert (config.network, config.setting, config.appearance, config.train.seed) == ("lss", "180", False, 7)
    assert base.differences(config) == ["network", "setting", "appearance", "train.seed"]
    assert StudyRow("appocc", "360", BOTH, 0).config(base).differences(base) == ["network"]


def test_rows_are_chosen_by_a_part_of_their_name() -> None:
    assert chosen_rows(ROWS, None) == ROWS
    assert [row.name for row in chosen_rows(ROWS, "^lss|ipm-180")] == [
        "lss-360-occupancy-s5",
        "lss-180-occupancy-s5",
        "ipm-180-colour",
    ]


@pytest.mark.parametrize(("pattern", "said"), [("(", "regular expression"), ("lsss", "of appocc-360-occupancy-s5, ")])
def test_a_pattern_without_match_is_refused(pattern: str, said: str) -> None:
    with pytest.raises(DataError, match=said):
        chosen_rows(ROWS, pattern)
