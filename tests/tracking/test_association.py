from __future__ import annotations

from dataclasses import replace

import numpy as np
from made_map import BLUE, RED

from appocc.checks import FloatArray
from tracking.association import AssociationConfig, associate

UNKNOWN = (np.nan,) * 3
Spot = tuple[float, float]


def pairs(
    tracks: list[Spot],
    blobs: list[Spot],
    track_rgb: list[tuple[float, ...]] | None = None,
    blob_rgb: list[tuple[float, ...]] | None = None,
    variance_m2: FloatArray | None = None,
    config: AssociationConfig | None = None,
) -> dict[int, int]:
    """Blob of each track; colours are unknown, variances 0.1 m2, unless said."""
    variance = (
        np.full((len(tracks), len(blobs)), 0.1) if variance_m2 is None else np.tile(variance_m2[:, None], len(blobs))
    )
    rows, columns = associate(
        np.array(tracks, np.float64).reshape(-1, 2),
        variance,
        np.array(track_rgb or [UNKNOWN] * len(tracks), np.float64).reshape(-1, 3),
        np.array(blobs, np.float64).reshape(-1, 2),
        np.array(blob_rgb or [UNKNOWN] * len(blobs), np.float64).reshape(-1, 3),
        config or AssociationConfig(),
    )
    return dict(zip(rows.tolist(), columns.tolist(), strict=True))


def test_the_whole_is_optimal_not_the_first() -> None:
    assert pairs([(0, 0), (1, 0)], [(0.9, 0), (2.2, 0)]) == {0: 0, 1: 1}


def test_nothing_beyond_the_gate() -> None:
    assert pairs([(0, 0)], [(2.6, 0)]) == {}
    assert pairs([(0, 0)], [(2.4, 0)]) == {0: 0}


def test_an_uncertain_track_looks_farther_but_not_endlessly() -> None:
    assert pairs([(0, 0)], [(6, 0)], variance_m2=np.array([9.0])) == {0: 0}
    assert pairs([(0, 0)], [(11, 0)], variance_m2=np.array([1e4])) == {}


def test_a_certain_track_goes_before_an_uncertain_one() -> None:
    assert pairs([(0, 0), (0.5, 0)], [(0.4, 0)], variance_m2=np.array([0.1, 30.0])) == {0: 0}


def test_colour_tells_neighbours_apart() -> None:
    tracks: list[Spot] = [(0, 0), (1.2, 0)]
    crossed: list[Spot] = [(0.5, 0), (0.7, 0)]
    assert pairs(tracks, crossed) == {0: 0, 1: 1}
    assert pairs(tracks, crossed, [RED, BLUE], [BLUE, RED]) == {0: 1, 1: 0}
    without = replace(AssociationConfig(), colour_cap=0.0)
    assert pairs(tracks, crossed, [RED, BLUE], [BLUE, RED], config=without) == {0: 0, 1: 1}


def test_colour_does_not_overrule_a_clear_place() -> None:
    assert pairs([(0, 0), (5, 0)], [(0, 0), (5, 0)], [RED, BLUE], [BLUE, RED]) == {0: 0, 1: 1}


def test_an_unknown_colour_is_between_like_and_unlike() -> None:
    blobs: list[Spot] = [(0.5, 0), (-0.5, 0)]
    assert pairs([(0, 0)], blobs, [RED], [UNKNOWN, BLUE]) == {0: 0}
    assert pairs([(0, 0)], blobs, [RED], [UNKNOWN, RED]) == {0: 1}


def test_more_blobs_than_tracks_and_none_at_all() -> None:
    assert pairs([(0, 0)], [(9, 9), (0.1, 0), (5, 5)]) == {0: 1}
    assert pairs([(0, 0)], []) == {}
