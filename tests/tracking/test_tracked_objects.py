"""Objects of maps with the velocities and paints of their tracks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_map import pose
from made_objects import made_object, together

from appocc.bevmap import BEVMap
from appocc.checks import FloatArray
from appocc.grid import BEVGrid
from appocc.objects import BEVObjects
from tracking.pipeline.tracked_objects import TrackedObjects

GRID = BEVGrid(-40.0, 40.0, -40.0, 40.0, 0.4)
STEP_US = 500_000
UNKNOWN = (np.nan, np.nan)
META = {"source": "predicted", "object_threshold": 0.4, "thresholds": {"road": 0.5, "vehicle": 0.5, "lane": 0.5}}


def map_of(objects: BEVObjects | None) -> BEVMap:
    """A map that is known everywhere."""
    shape = (3, *GRID.shape)
    known = np.ones(shape, np.bool_)
    return BEVMap(GRID, np.zeros(shape, np.float32), known, np.zeros(shape, np.uint8), known[0].copy(), META, objects)


def completed(tracked: TrackedObjects, objects: BEVObjects, step: int, ego: FloatArray | None = None) -> BEVObjects:
    found = tracked(map_of(objects), step * STEP_US, np.eye(4) if ego is None else ego).objects
    assert found is not None
    return found


def car(x_m: float, y_m: float = 0.0, **changes: object) -> BEVObjects:
    return made_object("car", x_m, y_m, velocity_mps=UNKNOWN, **changes)


def test_velocities_are_known_from_the_third_map_on() -> None:
    tracked = TrackedObjects()
    found = [completed(tracked, together(car(6.0 + 4 * k), car(12.0, 8.0)), k) for k in range(4)]
    for early in found[:2]:
        assert np.isnan(early.velocity_mps).all()
    for late in found[2:]:
        np.testing.assert_allclose(late.velocity_mps, [[8.0, 0.0], [0.0, 0.0]], atol=1.0)
    np.testing.assert_array_equal(found[3].velocity_mps[1], 0)


def test_velocities_are_over_ground_along_the_axes_of_the_ego() -> None:
    tracked = TrackedObjects()
    # The ego drives along world y, beside a car that is as fast and past one that is parked.
    for k in range(4):
        ego = pose(100.0, 5.0 * k, np.pi / 2)
        found = completed(tracked, together(car(3.0, 4.0), car(20.0 - 5.0 * k, -4.0)), k, ego)
    np.testing.assert_allclose(found.velocity_mps, [[10.0, 0.0], [0.0, 0.0]], atol=1.0)


def test_a_paint_is_the_mean_of_the_maps_and_the_nearer_weighs_more() -> None:
    tracked = TrackedObjects()
    completed(tracked, car(30.0, rgb=(200.0, 40.0, 40.0)), 0)
    near = completed(tracked, car(30.0, rgb=(100.0, 40.0, 40.0)), 1, pose(22.0, 0.0, 0.0))  # still 30 m ahead
    far = TrackedObjects()
    completed(far, car(30.0, rgb=(200.0, 40.0, 40.0)), 0)
    approached = completed(far, car(8.0, rgb=(100.0, 40.0, 40.0)), 1, pose(22.0, 0.0, 0.0))
    assert near.rgb[0, 0] == pytest.approx(100.0)  # another car, 22 m further on
    assert 100 < approached.rgb[0, 0] < 110
    np.testing.assert_allclose(approached.rgb[0, 1:], 40)


def test_a_paint_that_a_map_does_not_know_is_that_of_the_maps_before() -> None:
    tracked = TrackedObjects()
    completed(tracked, car(10.0, rgb=(200.0, 40.0, 40.0)), 0)
    found = completed(tracked, car(10.0, rgb=(np.nan, np.nan, np.nan)), 1)
    np.testing.assert_allclose(found.rgb, [[200, 40, 40]])


def test_light_changes_slowly_and_the_paint_follows() -> None:
    tracked = TrackedObjects()
    for k in range(4):
        bright = completed(tracked, car(10.0, rgb=(200.0, 200.0, 200.0)), k)
    for k in range(4, 12):
        dark = completed(tracked, car(10.0, rgb=(60.0, 60.0, 60.0)), k)
    np.testing.assert_allclose(bright.rgb, 200)
    assert 60 < dark.rgb[0, 0] < 70


def test_places_sizes_headings_and_scores_stay_those_of_the_map() -> None:
    tracked = TrackedObjects()
    for k, length_m in enumerate((4.0, 4.8, 4.4)):
        own = car(10.0 + 0.1 * k, yaw_rad=0.1 * k, size_wlh_m=(1.8, length_m, 1.5), score=0.9 - 0.1 * k)
        found = completed(tracked, own, k)
        for name in ("centre_m", "size_wlh_m", "yaw_rad", "score"):
            np.testing.assert_array_equal(getattr(found, name), getattr(own, name))
        assert found.kind == own.kind


def test_objects_in_unknown_cells_keep_what_they_have() -> None:
    tracked = TrackedObjects()
    bev = map_of(together(made_object("bus", -10.0, 0.0, velocity_mps=(3.0, 0.0)), car(10.0)))
    known = bev.occupancy_valid.copy()
    known[:, : GRID.shape[0] // 2] = False
    for k in range(3):
        found = tracked(replace(bev, occupancy_valid=known), k * STEP_US, np.eye(4)).objects
    assert found is not None
    np.testing.assert_array_equal(found.velocity_mps, [[3, 0], [0, 0]])


@pytest.mark.parametrize("anew", ["reset", "earlier"])
def test_another_drive_begins_anew(anew: str) -> None:
    tracked = TrackedObjects()
    for k in range(3):
        completed(tracked, car(10.0, rgb=(200.0, 40.0, 40.0)), k)
    if anew == "reset":
        tracked.reset()
    found = completed(tracked, car(10.0, rgb=(40.0, 40.0, 200.0)), 3 if anew == "reset" else 2)
    assert np.isnan(found.velocity_mps).all()
    np.testing.assert_allclose(found.rgb, [[40, 40, 200]])


def test_maps_without_objects_stay_as_they_are() -> None:
    bev = map_of(None)
    assert TrackedObjects()(bev, 0, np.eye(4)) is bev
    assert completed(TrackedObjects(), car(0.0).select(np.zeros(0, np.int64)), 0).kind == ()
