"""Generated street layouts, before SUMO."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from appocc.simulation.town_generation.layout import Layout, Street, draw_layout


def _directed(layout: Layout) -> list[tuple[str, str, str]]:
    ahead = [(s.start, s.end, s.name) for s in layout.streets]
    return ahead + [(s.end, s.start, s.name) for s in layout.streets if s.lanes[1]]


@pytest.mark.parametrize("seed", range(40, 52))
def test_every_street_can_be_reached_from_every_other(seed: int) -> None:
    ways = _directed(draw_layout(seed))
    for first in (0, len(ways) // 2):
        seen, todo = {first}, [first]
        while todo:
            now = ways[todo.pop()]
            fresh = [k for k, way in enumerate(ways) if way[0] == now[1] and way[2] != now[2] and k not in seen]
            seen.update(fresh)
            todo += fresh
        assert len(seen) == len(ways)


@pytest.mark.parametrize("seed", range(40, 52))
def test_streets_are_smooth_and_end_at_their_crossings(seed: int) -> None:
    layout = draw_layout(seed)
    places = {crossing.name: crossing.xy_m for crossing in layout.crossings}
    assert len(places) == len(layout.crossings)
    arms = Counter(name for street in layout.streets for name in (street.start, street.end))
    assert set(arms) == set(places)
    assert min(arms.values()) >= 3
    for street in layout.streets:
        np.testing.assert_allclose(street.line_m[0], places[street.start], atol=0.01)
        np.testing.assert_allclose(street.line_m[-1], places[street.end], atol=0.01)
        assert np.rad2deg(np.abs(_turns(street)).max()) < 25
    size = np.ptp(np.concatenate([street.line_m for street in layout.streets]), axis=0)
    assert (size > 330).all()
    assert (size < 560).all()


def _turns(street: Street) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    step = np.diff(street.line_m, axis=0)
    return np.asarray(np.diff(np.unwrap(np.arctan2(step[:, 1], step[:, 0]))))


def test_towns_have_all_kinds_of_streets() -> None:
    layouts = [draw_layout(seed) for seed in range(40, 52)]
    streets = [street for layout in layouts for street in layout.streets]
    assert any(street.lanes == (2, 2) for street in streets)
    assert any(street.lanes == (1, 0) and street.parking[0] for street in streets)
    assert sum(any(s.name.startswith("o") for s in layout.streets) for layout in layouts) > 3  # roundabouts
    assert any(crossing.kind == "traffic_light" for layout in layouts for crossing in layout.crossings)


def test_layout_depends_on_the_seed() -> None:
    first, second, other = draw_layout(7), draw_layout(7), draw_layout(8)
    assert [s.line_m.tobytes() for s in first.streets] == [s.line_m.tobytes() for s in second.streets]
    assert [s.line_m.tobytes() for s in first.streets] != [s.line_m.tobytes() for s in other.streets]
