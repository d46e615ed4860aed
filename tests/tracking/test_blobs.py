from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_map import BLACK, BLUE, RED, WHITE, Car, map_of

from appocc.bevmap import VEHICLE, BEVMap
from appocc.errors import ShapeError
from appocc.grid import BEVGrid
from tracking.blobs import BlobConfig, Blobs, find_blobs


def test_a_car_is_found_where_it_stands() -> None:
    blobs = find_blobs(map_of([Car(12.3, -7.1, 0.6, RED)], probability=0.75))
    assert len(blobs) == 1
    np.testing.assert_allclose(blobs.centroid_m[0], [12.3, -7.1], atol=0.1)
    np.testing.assert_allclose(blobs.yaw_rad[0], 0.6, atol=0.06)
    np.testing.assert_allclose([blobs.length_m[0], blobs.width_m[0]], [4.5, 1.8], atol=0.25)
    np.testing.assert_allclose(blobs.rgb[0], RED)
    assert blobs.confidence[0] == pytest.approx(0.75)
    assert not blobs.touches_border[0]


def test_an_empty_map_has_no_blobs() -> None:
    assert len(find_blobs(map_of([]))) == 0


def test_specks_are_dropped() -> None:
    speck = Car(5.0, 5.2, length_m=0.4, width_m=0.8)
    assert len(find_blobs(map_of([speck]))) == 0
    assert len(find_blobs(map_of([speck]), BlobConfig(min_area_m2=0.1))) == 1


def test_a_colour_nobody_saw_is_unknown() -> None:
    blobs = find_blobs(map_of([Car(10, 0, rgb=None), Car(-10, 0, rgb=BLUE)]))
    order = np.argsort(blobs.centroid_m[:, 0])
    np.testing.assert_allclose(blobs.rgb[order], [BLUE, [np.nan] * 3])


def test_cells_whose_class_is_unknown_make_no_blob() -> None:
    bev = map_of([Car(10, 0)])
    valid = bev.occupancy_valid.copy()
    valid[VEHICLE] = False
    hidden = BEVMap(bev.grid, bev.occupancy, valid, bev.appearance, bev.appearance_valid)
    assert len(find_blobs(hidden)) == 0


def test_the_threshold_of_the_map_decides() -> None:
    bev = map_of([Car(10, 0)], probability=0.45)
    assert len(find_blobs(bev)) == 0
    assert len(find_blobs(replace(bev, meta={"thresholds": {"road": 0.5, "vehicle": 0.4, "lane": 0.5}}))) == 1


def test_a_car_at_the_rim_is_marked_as_cut() -> None:
    blobs = find_blobs(map_of([Car(39.5, 0.0), Car(20.0, 0.0)]))
    assert blobs.touches_border.tolist() == (blobs.centroid_m[:, 0] > 30).tolist()


def test_cover_knows_the_turned_boxes() -> None:
    blobs = find_blobs(map_of([Car(10.0, 5.0, np.pi / 4, length_m=6.0)]))
    along = np.array([np.cos(np.pi / 4), np.sin(np.pi / 4)])
    points = np.array([10.0, 5.0]) + np.array([[0, 0], 2.6 * along, -2.6 * along, 3.6 * along, [2.0, -2.0]])
    assert blobs.cover(points).tolist() == [[True], [True], [True], [False], [False]]


def test_shapes_are_checked() -> None:
    good = find_blobs(map_of([Car(10, 0)]))
    with pytest.raises(ShapeError, match=r"blobs yaw_rad: expected shape \(1\), got \(2,\)"):
        Blobs(
            good.centroid_m,
            np.zeros(2),
            good.length_m,
            good.width_m,
            good.area_m2,
            good.rgb,
            good.confidence,
            good.touches_border,
            good.grid,
        )


# Touching vehicles ------------------------------------------------------------------------------------------------


def places(cars: list[Car], config: BlobConfig | None = None) -> list[list[float]]:
    """Centroids of the blobs of some cars, in order of x, then y, to 0.1 m."""
    found = find_blobs(map_of(cars), config).centroid_m
    return sorted(np.round(found, 1).tolist())


def test_cars_bumper_to_bumper_are_cut_apart() -> None:
    cars = [Car(10.0, 3.0), Car(14.6, 3.0), Car(19.2, 3.0)]
    assert len(places(cars, BlobConfig(split=False))) == 1
    found = places(cars)
    assert len(found) == 3
    np.testing.assert_allclose(found, [[10.0, 3.0], [14.6, 3.0], [19.2, 3.0]], atol=0.35)


def test_cars_side_by_side_are_cut_apart() -> None:
    cars = [Car(10.0, 3.0), Car(10.0, 4.9)]
    assert len(places(cars, BlobConfig(split=False))) == 1
    np.testing.assert_allclose(places(cars), [[10.0, 3.0], [10.0, 4.9]], atol=0.35)


def test_a_cut_follows_the_colours() -> None:
    """A trailer and its tractor: equal halves would put both centres in the wrong place."""
    cars = [Car(10.0, 0.0, rgb=WHITE, length_m=11.6, width_m=2.4), Car(18.8, 0.0, rgb=RED, length_m=6.0, width_m=2.4)]
    blobs = find_blobs(map_of(cars))
    order = np.argsort(blobs.centroid_m[:, 0])
    np.testing.assert_allclose(blobs.centroid_m[order], [[10.0, 0.0], [18.8, 0.0]], atol=0.3)
    np.testing.assert_allclose(blobs.rgb[order], [WHITE, RED], atol=15)


def test_a_car_with_a_black_windscreen_is_one_car() -> None:
    bev = map_of([Car(10.0, 0.0)])
    appearance = bev.appearance.copy()
    appearance[:, 126:128, 90:110] = 10
    painted = BEVMap(bev.grid, bev.occupancy, bev.occupancy_valid, appearance, bev.appearance_valid)
    assert len(find_blobs(painted)) == 1


def test_a_row_of_cars_with_windscreens_is_cut_between_the_cars() -> None:
    bev = map_of([Car(10.0, 0.0, rgb=WHITE), Car(14.6, 0.0, rgb=BLUE)])
    appearance = bev.appearance.copy()
    appearance[:, [127, 138]] = np.array(BLACK, np.uint8)[:, None, None]
    painted = BEVMap(bev.grid, bev.occupancy, bev.occupancy_valid, appearance, bev.appearance_valid)
    blobs = find_blobs(painted)
    np.testing.assert_allclose(np.sort(blobs.centroid_m[:, 0]), [10.0, 14.6], atol=0.35)


@pytest.mark.parametrize(("length_m", "width_m"), [(12.0, 2.9), (6.0, 2.3), (4.0, 3.0), (9.5, 3.5)])
def test_single_large_vehicles_stay_whole(length_m: float, width_m: float) -> None:
    for yaw in (0.0, 0.4, 0.8):
        assert len(find_blobs(map_of([Car(10.0, 5.0, yaw, length_m=length_m, width_m=width_m)]))) == 1


def test_what_cannot_be_cut_into_vehicles_stays_whole() -> None:
    ring = [Car(10, 0, length_m=12, width_m=1), Car(10, 6, length_m=12, width_m=1)]
    ring += [Car(4.4, 3, np.pi / 2, length_m=7, width_m=0.6), Car(15.6, 3, np.pi / 2, length_m=7, width_m=0.6)]
    assert len(find_blobs(map_of(ring))) == 1


def test_unknown_colours_do_not_keep_cars_from_being_cut() -> None:
    found = places([Car(10.0, 3.0, rgb=None), Car(14.6, 3.0, rgb=None)])
    np.testing.assert_allclose(found, [[10.0, 3.0], [14.6, 3.0]], atol=0.35)


def test_coarse_grids_work() -> None:
    grid = BEVGrid(cell_m=2.0)
    found = find_blobs(map_of([Car(10.0, 1.0, length_m=8.0, width_m=2.0)], grid=grid)).centroid_m
    np.testing.assert_allclose(np.sort(found[:, 0]), [8.0, 12.0])


def test_a_single_cell_larger_than_cars_is_not_cut() -> None:
    grid = BEVGrid(cell_m=80.0)
    one = np.ones((3, 1, 1), np.bool_)
    bev = BEVMap(grid, one.astype(np.float32), one, one.astype(np.uint8), one[0].copy())
    assert len(find_blobs(bev)) == 1
