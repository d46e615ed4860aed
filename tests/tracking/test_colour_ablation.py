from __future__ import annotations

import numpy as np
import pytest

from benchmarks.colour_ablation import (
    HEAD,
    Step,
    Trial,
    judged,
    made_scene,
    switches_of,
    without_colour,
    wrongly_coloured,
)
from benchmarks.encounters import MIX, encounters
from tracking.evaluation.clear_id_hota import Metrics
from tracking.presets import MAPS


@pytest.fixture(scope="module")
def scene() -> list[Step]:
    return made_scene(3, noisy=False)[:12]


def test_the_same_seed_is_the_same_traffic() -> None:
    one, other = (encounters(5, seconds=2.0) for _ in range(2))
    assert [step.number.tolist() for step in one] == [step.number.tolist() for step in other]
    np.testing.assert_array_equal(one[-1].xy_m, other[-1].xy_m)


def test_traffic_moves_parks_hides_and_keeps_its_paint() -> None:
    moments = encounters(2, seconds=6.0)
    assert [moment.timestamp_us for moment in moments[:3]] == [0, 500_000, 1_000_000]
    first, last = (
        {n: (xy, tuple(rgb)) for n, xy, rgb in zip(m.number, m.xy_m, m.rgb, strict=True)}
        for m in (moments[0], moments[-1])
    )
    both = sorted(set(first) & set(last))
    moved_m = np.array([np.hypot(*(last[n][0] - first[n][0])) for n in both])
    assert (moved_m == 0).any()
    assert 10 < moved_m.max() < 6 * 14 + 1
    assert all(first[n][1] == last[n][1] for n in both)
    assert 0.1 < np.mean([moment.seen.mean() for moment in moments]) < 0.9
    assert max(moment.size_m[:, 1].max() for moment in moments) <= 1.1 * max(size[1] for _, size in MIX.values())


def test_what_is_hidden_is_neither_shown_nor_demanded(scene: list[Step]) -> None:
    for step in scene:
        assert len(step.detections) < len(step.number)
        assert step.demanded.sum() <= len(step.detections) + 2  # two that touch may be one blob


def test_the_blind_tracker_is_blind(scene: list[Step]) -> None:
    grey = [
        step._replace(detections=wrongly_coloured([step], np.random.default_rng(k))[0].detections)
        for k, step in enumerate(scene)
    ]
    blind = without_colour(MAPS)
    assert judged(scene, blind) == judged(grey, blind)


def scores(ids: int) -> Metrics:
    made = judged(made_scene(3, noisy=False)[:2], MAPS)
    return made.__class__(**{**made.__dict__, "IDS": ids})


def test_benchmark_rows_show_effect_and_confidence() -> None:
    one, two = scores(1), scores(2)
    row = dict(zip(HEAD, Trial("exact", [one] * 12, [two] * 12).row(), strict=True))
    assert row["IDS with / without"] == "12 / 24"
    assert row["fewer %"] == "50 (50 to 50)"
    assert float(row["p"]) < 0.001
    row = dict(zip(HEAD, Trial("exact", [one] * 12, [one] * 12).row(), strict=True))
    assert (row["fewer %"], row["p"]) == ("0 (0 to 0)", "1.0000")


def test_the_switches_of_several_orders_are_averaged() -> None:
    trials = [Trial("one", [scores(6)], [scores(4)]), Trial("two", [scores(4)], [scores(4)])]
    assert switches_of(trials) == "switches, mean of the orders: 5 / 4, +25 %"


def test_colour_keeps_identities_and_wrong_colours_do_no_more_harm_than_stated() -> None:
    """The documentation's bound: colours that are always wrong cost at most a quarter more switches than none."""
    scenes = [made_scene(seed, noisy=False) for seed in range(5)]
    blind = sum(judged(scene, without_colour(MAPS)).IDS for scene in scenes)
    assert blind > 25
    assert sum(judged(scene, MAPS).IDS for scene in scenes) < 0.6 * blind
    orders = [np.random.default_rng(seed) for seed in range(1, 4)]
    wrong = [judged(wrongly_coloured(scene, order), MAPS).IDS for order in orders for scene in scenes]
    assert sum(wrong) < 1.25 * len(orders) * blind
