from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_map import BLACK, BLUE, RED, WHITE, Car, map_of

from appocc.bevmap import VEHICLE, BEVMap
from appocc.checks import FloatArray
from appocc.colours import lab_from_rgb
from appocc.errors import ShapeError
from appocc.grid import BEVGrid
from tracking.detections import Detections
from tracking.field_of_view import GridView
from tracking.instances.instances import (
    InstanceConfig,
    Instances,
    find_instances,
    label_instances,
    measure_instances,
)


def test_a_car_is_found_at_its_position() -> None:
    blobs = find_instances(map_of([Car(12.3, -7.1, 0.6, RED)], probability=0.75))
    assert len(blobs) == 1
    np.testing.assert_allclose(blobs.centroid_m[0], [12.3, -7.1], atol=0.1)
    np.testing.assert_allclose(blobs.yaw_rad[0], 0.6, atol=0.06)
    np.testing.assert_allclose([blobs.length_m[0], blobs.width_m[0]], [4.5, 1.8], atol=0.25)
    np.testing.assert_allclose(blobs.rgb[0], RED)
    assert blobs.confidence[0] == pytest.approx(0.75)
    assert not blobs.touches_border[0]


def test_an_empty_map_has_no_blobs() -> None:
    assert len(find_instances(map_of([]))) == 0


def test_specks_are_dropped() -> None:
    speck = Car(5.0, 5.2, length_m=0.4, width_m=0.8)
    assert len(find_instances(map_of([speck]))) == 0
    assert len(find_instances(map_of([speck]), InstanceConfig(min_area_m2=0.1))) == 1


def test_a_colour_without_known_cells_is_unknown() -> None:
    blobs = find_instances(map_of([Car(10, 0, rgb=None), Car(-10, 0, rgb=BLUE)]))
    order = np.argsort(blobs.centroid_m[:, 0])
    np.testing.assert_allclose(blobs.rgb[order], [BLUE, [np.nan] * 3])


def test_cells_of_unknown_class_make_no_instance() -> None:
    bev = map_of([Car(10, 0)])
    valid = bev.occupancy_valid.copy()
    valid[VEHICLE] = False
    hidden = BEVMap(bev.grid, bev.occupancy, valid, bev.appearance, bev.appearance_valid)
    assert len(find_instances(hidden)) == 0


def test_the_threshold_of_the_map_decides() -> None:
    bev = map_of([Car(10, 0)], probability=0.45)
    assert len(find_instances(bev)) == 0
    assert len(find_instances(replace(bev, meta={"thresholds": {"road": 0.5, "vehicle": 0.4, "lane": 0.5}}))) == 1


def test_a_car_at_the_rim_is_marked_as_cut() -> None:
    blobs = find_instances(map_of([Car(39.5, 0.0), Car(20.0, 0.0)]))
    assert blobs.touches_border.tolist() == (blobs.centroid_m[:, 0] > 30).tolist()


def test_labels_number_the_blobs_without_gaps() -> None:
    speck = Car(5.0, 5.2, length_m=0.4, width_m=0.8)
    bev = map_of([Car(-10, 0), speck, Car(10, 0)])
    labels, count = label_instances(bev, InstanceConfig())
    assert count == 2
    assert np.unique(labels).tolist() == [0, 1, 2]
    blobs = measure_instances(bev, labels, count)
    np.testing.assert_array_equal(blobs.area_m2, np.bincount(labels[labels > 0])[1:] * 0.4**2)


def test_some_blobs_can_be_chosen() -> None:
    blobs = find_instances(map_of([Car(-10, 0, rgb=RED), Car(10, 0, rgb=BLUE)]))
    for chosen in (blobs.select(blobs.centroid_m[:, 0] > 0), blobs.select(np.array([1]))):
        assert len(chosen) == 1
        np.testing.assert_array_equal(chosen.rgb, [BLUE])
        assert chosen.view is blobs.view


# Colours ----------------------------------------------------------------------------------------------------------


def painted(bev: BEVMap, x: slice, y: slice, rgb: tuple[int, int, int]) -> BEVMap:
    """A map with some cells in another colour."""
    appearance = bev.appearance.copy()
    appearance[:, x, y] = np.array(rgb, np.uint8)[:, None, None]
    return replace(bev, appearance=appearance)


def test_the_robust_colour_of_one_colour_is_that_colour() -> None:
    blobs = find_instances(map_of([Car(10.0, 0.0, 0.3, RED)]))
    np.testing.assert_allclose(blobs.lab, lab_from_rgb([RED]), atol=1e-9)


def test_the_robust_colour_is_of_the_paint_and_not_of_windows_and_rims() -> None:
    """A car of 12 x 5 cells: of the 10 x 3 inside, three columns are glass and one cell is a lamp."""
    bev = map_of([Car(10.0, 0.2, rgb=RED, length_m=4.8, width_m=2.0)])
    x, y = np.nonzero(bev.on[VEHICLE])
    assert [x.max() - x.min(), y.max() - y.min(), len(x)] == [11, 4, 60]
    rim, glass, lamp = (120, 125, 130), (25, 25, 30), (255, 250, 240)
    dirty = painted(bev, slice(x.min(), x.max() + 1), slice(y.min(), y.max() + 1), rim)
    dirty = painted(dirty, slice(x.min() + 1, x.max()), slice(y.min() + 1, y.max()), RED)
    dirty = painted(dirty, slice(x.min() + 3, x.min() + 6), slice(y.min() + 1, y.max()), glass)
    dirty = painted(dirty, slice(x.max() - 1, x.max()), slice(y.max() - 1, y.max()), lamp)
    blobs = find_instances(dirty)
    np.testing.assert_allclose(blobs.lab, lab_from_rgb([RED]), atol=1e-9)
    np.testing.assert_allclose(
        blobs.rgb[0], (30 * np.array(rim) + 9 * np.array(glass) + lamp + 20 * np.array(RED)) / 60
    )


def test_a_car_at_the_rim_of_the_grid_has_its_colour_and_not_its_neighbours() -> None:
    blobs = find_instances(map_of([Car(39.0, 39.6, rgb=BLUE), Car(39.0, -39.6, rgb=RED), Car(-39.0, 39.6, rgb=RED)]))
    corner = (blobs.centroid_m > 0).all(axis=1)
    np.testing.assert_allclose(blobs.lab[corner], lab_from_rgb([BLUE]), atol=1e-9)
    np.testing.assert_allclose(blobs.lab[~corner], lab_from_rgb([RED, RED]), atol=1e-9)


def test_a_robust_colour_without_known_cells_is_unknown() -> None:
    blobs = find_instances(map_of([Car(10, 0, rgb=None), Car(-10, 0, rgb=BLUE)]))
    order = np.argsort(blobs.centroid_m[:, 0])
    np.testing.assert_allclose(blobs.lab[order], lab_from_rgb([BLUE, [np.nan] * 3]), atol=1e-9)


# As detections ----------------------------------------------------------------------------------------------------


def test_blobs_are_detections() -> None:
    blobs = find_instances(map_of([Car(39.5, 0.0, rgb=None), Car(20.0, 0.0, 0.4, RED)], probability=0.75))
    seen = Detections.from_instances(blobs)
    np.testing.assert_array_equal(seen.ground_m, np.column_stack([blobs.centroid_m, [0.0, 0.0]]))
    np.testing.assert_array_equal(seen.yaw_rad, blobs.yaw_rad)
    assert seen.heading_known.tolist() == [False, False]
    np.testing.assert_array_equal(seen.size_m, np.column_stack([blobs.width_m, blobs.length_m, [np.nan] * 2]))
    np.testing.assert_allclose(seen.log_odds, np.log(3))
    assert seen.kind == ("vehicle", "vehicle")
    np.testing.assert_array_equal(seen.rgb, blobs.rgb)
    np.testing.assert_array_equal(seen.lab, blobs.lab)
    assert seen.truncated.tolist() == blobs.touches_border.tolist()
    assert seen.view is blobs.view


def test_no_blobs_are_no_detections() -> None:
    assert len(Detections.from_instances(find_instances(map_of([])))) == 0


def test_a_grid_sees_what_lies_in_its_cells() -> None:
    points = np.array([[0.0, 0.0], [39.99, -40.0], [40.0, 0.0], [0.0, -40.01], [-1.0, 5.0]])
    assert GridView(BEVGrid.surround()).sees(points).tolist() == [True, True, False, False, True]
    assert GridView(BEVGrid.front()).sees(points).tolist() == [True, True, False, False, False]


def test_cells_that_no_camera_sees_are_blind_spots_and_hold_no_blob() -> None:
    bev = map_of([Car(10.0, 0.0), Car(-10.0, 0.0), Car(20.0, 6.0)])
    known = np.broadcast_to(bev.grid.centres()[..., 0] > 9.0, bev.occupancy_valid.shape).copy()
    blobs = find_instances(replace(bev, occupancy_valid=known))
    assert np.round(blobs.centroid_m[:, 1], 1).tolist() == [0.0, 6.0]
    assert blobs.touches_border.tolist() == [True, False]  # the first one goes on where nothing is known
    points = np.array([[20.0, 0.0], [0.0, 0.0], [-50.0, 0.0]])
    assert blobs.view.blind(points).tolist() == [False, True, False]
    assert blobs.view.sees(points).tolist() == [True, True, False]
    assert not find_instances(bev).view.blind(points).any()


def test_cover_knows_the_turned_boxes() -> None:
    blobs = find_instances(map_of([Car(10.0, 5.0, np.pi / 4, length_m=6.0)]))
    along = np.array([np.cos(np.pi / 4), np.sin(np.pi / 4)])
    points = np.array([10.0, 5.0]) + np.array([[0, 0], 2.6 * along, -2.6 * along, 3.6 * along, [2.0, -2.0]])
    covered, by = Detections.from_instances(blobs).find_containing(points)
    assert (sorted(covered.tolist()), by.tolist()) == ([0, 1, 2], [0, 0, 0])


def test_shapes_are_checked() -> None:
    good = find_instances(map_of([Car(10, 0)]))
    with pytest.raises(ShapeError, match=r"instances yaw_rad: expected shape \(1\), got \(2,\)"):
        Instances(
            centroid_m=good.centroid_m,
            yaw_rad=np.zeros(2),
            length_m=good.length_m,
            width_m=good.width_m,
            area_m2=good.area_m2,
            rgb=good.rgb,
            lab=good.lab,
            confidence=good.confidence,
            touches_border=good.touches_border,
            view=good.view,
        )


# Touching vehicles ------------------------------------------------------------------------------------------------


def places(cars: list[Car], config: InstanceConfig | None = None) -> list[list[float]]:
    """Centroids of the instances of some cars, in order of x, then y, to 0.1 m."""
    found = find_instances(map_of(cars), config).centroid_m
    return sorted(np.round(found, 1).tolist())


def test_cars_bumper_to_bumper_are_cut_apart() -> None:
    cars = [Car(10.0, 3.0), Car(14.6, 3.0), Car(19.2, 3.0)]
    assert len(places(cars, InstanceConfig(split=False))) == 1
    found = places(cars)
    assert len(found) == 3
    np.testing.assert_allclose(found, [[10.0, 3.0], [14.6, 3.0], [19.2, 3.0]], atol=0.35)


def test_cars_side_by_side_are_cut_apart() -> None:
    cars = [Car(10.0, 3.0), Car(10.0, 4.9)]
    assert len(places(cars, InstanceConfig(split=False))) == 1
    np.testing.assert_allclose(places(cars), [[10.0, 3.0], [10.0, 4.9]], atol=0.35)


def test_a_cut_follows_the_colours() -> None:
    """A trailer and its tractor: equal halves would put both centres in the wrong place."""
    cars = [Car(10.0, 0.0, rgb=WHITE, length_m=11.6, width_m=2.4), Car(18.8, 0.0, rgb=RED, length_m=6.0, width_m=2.4)]
    blobs = find_instances(map_of(cars))
    order = np.argsort(blobs.centroid_m[:, 0])
    np.testing.assert_allclose(blobs.centroid_m[order], [[10.0, 0.0], [18.8, 0.0]], atol=0.3)
    np.testing.assert_allclose(blobs.rgb[order], [WHITE, RED], atol=15)


def test_a_car_with_a_black_windscreen_is_one_car() -> None:
    bev = map_of([Car(10.0, 0.0)])
    appearance = bev.appearance.copy()
    appearance[:, 126:128, 90:110] = 10
    painted = BEVMap(bev.grid, bev.occupancy, bev.occupancy_valid, appearance, bev.appearance_valid)
    assert len(find_instances(painted)) == 1


def test_a_row_of_cars_with_windscreens_is_cut_between_the_cars() -> None:
    bev = map_of([Car(10.0, 0.0, rgb=WHITE), Car(14.6, 0.0, rgb=BLUE)])
    appearance = bev.appearance.copy()
    appearance[:, [127, 138]] = np.array(BLACK, np.uint8)[:, None, None]
    painted = BEVMap(bev.grid, bev.occupancy, bev.occupancy_valid, appearance, bev.appearance_valid)
    blobs = find_instances(painted)
    np.testing.assert_allclose(np.sort(blobs.centroid_m[:, 0]), [10.0, 14.6], atol=0.35)


@pytest.mark.parametrize(("length_m", "width_m"), [(12.0, 2.9), (6.0, 2.3), (4.0, 3.0), (9.5, 3.5)])
def test_single_large_vehicles_are_not_split(length_m: float, width_m: float) -> None:
    for yaw in (0.0, 0.4, 0.8):
        assert len(find_instances(map_of([Car(10.0, 5.0, yaw, length_m=length_m, width_m=width_m)]))) == 1


def test_shapes_that_cannot_be_split_into_vehicles_are_kept() -> None:
    ring = [Car(10, 0, length_m=12, width_m=1), Car(10, 6, length_m=12, width_m=1)]
    ring += [Car(4.4, 3, np.pi / 2, length_m=7, width_m=0.6), Car(15.6, 3, np.pi / 2, length_m=7, width_m=0.6)]
    assert len(find_instances(map_of(ring))) == 1


def test_unknown_colours_do_not_keep_cars_from_being_cut() -> None:
    found = places([Car(10.0, 3.0, rgb=None), Car(14.6, 3.0, rgb=None)])
    np.testing.assert_allclose(found, [[10.0, 3.0], [14.6, 3.0]], atol=0.35)


# Touching vehicles in predicted maps ------------------------------------------------------------------------------


def bumps(places_m: list[tuple[float, float, float]], spread_m: tuple[float, float] = (1.0, 0.45)) -> BEVMap:
    """A map as networks make it: log-odds of a hill (x, y, log-odds at its top) each, the highest counts."""
    grid = BEVGrid.surround()
    xy = grid.centres()

    def hill(x_m: float, y_m: float, top: float) -> FloatArray:
        square = ((xy[..., 0] - x_m) / spread_m[0]) ** 2 + ((xy[..., 1] - y_m) / spread_m[1]) ** 2
        return top - square / 2

    log_odds = np.maximum(np.max([hill(*place) for place in places_m], axis=0), -20.0)
    occupancy = np.zeros((3, *grid.shape), np.float32)
    occupancy[VEHICLE] = 1 / (1 + np.exp(-log_odds))
    known = np.ones((3, *grid.shape), np.bool_)
    return BEVMap(grid, occupancy, known, np.zeros((3, *grid.shape), np.uint8), known[0].copy())


def test_cells_far_below_the_peak_of_their_group_are_no_vehicle() -> None:
    bev = map_of([Car(5.0, 0.0), Car(14.0, 0.0)], probability=0.95)
    occupancy = bev.occupancy.copy()
    between = (bev.grid.centres()[..., 0] > 5) & (bev.grid.centres()[..., 0] < 14) & (occupancy[VEHICLE] == 0)
    occupancy[VEHICLE][between & (np.abs(bev.grid.centres()[..., 1]) < 0.5)] = 0.6
    weak = np.abs(bev.grid.centres() - [30.0, 20.0]).max(axis=-1) < 1
    occupancy[VEHICLE][weak] = 0.6
    bridged = replace(bev, occupancy=occupancy)
    assert (
        len(find_instances(bridged, InstanceConfig(split=False, peak_share=0.0))) == 2
    )  # both cars, and what stands alone
    blobs = find_instances(bridged, InstanceConfig(split=False))
    order = np.argsort(blobs.centroid_m[:, 0])
    np.testing.assert_allclose(blobs.centroid_m[order], [[5.0, 0.0], [14.0, 0.0], [30.0, 20.0]], atol=0.15)
    np.testing.assert_allclose(blobs.confidence[order], [0.95, 0.95, 0.6], rtol=1e-6)


def test_certain_maps_do_not_depend_on_the_share_of_the_peak() -> None:
    bev = map_of([Car(10.0, 3.0), Car(14.6, 3.0), Car(-10.0, 4.9)])
    for share in (0.0, 0.5, 1.0):
        np.testing.assert_array_equal(
            label_instances(bev, InstanceConfig(peak_share=share))[0], label_instances(bev, InstanceConfig())[0]
        )


def test_a_queue_is_cut_at_its_valleys() -> None:
    bev = bumps([(-9.2, 3.0, 4.0), (-4.6, 3.0, 3.6), (0.0, 3.0, 4.2)])
    assert len(find_instances(bev, InstanceConfig(split=False))) == 1
    found = find_instances(bev).centroid_m
    np.testing.assert_allclose(found[np.argsort(found[:, 0])], [[-9.2, 3.0], [-4.6, 3.0], [0.0, 3.0]], atol=0.3)


def test_parked_side_by_side_they_are_cut_at_their_valleys() -> None:
    bev = bumps([(10.0, 0.0, 4.0), (10.0, 2.6, 4.2), (10.0, 5.2, 4.0)], (0.95, 0.55))
    assert len(find_instances(bev, InstanceConfig(split=False))) == 1
    found = find_instances(bev).centroid_m
    np.testing.assert_allclose(found[np.argsort(found[:, 1])], [[10.0, 0.0], [10.0, 2.6], [10.0, 5.2]], atol=0.3)


def test_a_car_with_two_peaks_is_one_car() -> None:
    bev = bumps([(9.0, 3.0, 3.6), (11.0, 3.0, 4.0)], (0.6, 0.45))
    blobs = find_instances(bev)
    assert len(blobs) == 1
    assert blobs.area_m2[0] > 8.0
    np.testing.assert_allclose(blobs.centroid_m, [[10.0, 3.0]], atol=0.3)


# Odd grids --------------------------------------------------------------------------------------------------------


def test_coarse_grids_work() -> None:
    grid = BEVGrid(cell_m=2.0)
    found = find_instances(map_of([Car(10.0, 1.0, length_m=8.0, width_m=2.0)], grid=grid)).centroid_m
    np.testing.assert_allclose(np.sort(found[:, 0]), [8.0, 12.0])


def test_a_single_cell_larger_than_cars_is_not_cut() -> None:
    grid = BEVGrid(cell_m=80.0)
    one = np.ones((3, 1, 1), np.bool_)
    bev = BEVMap(grid, one.astype(np.float32), one, one.astype(np.uint8), one[0].copy())
    assert len(find_instances(bev)) == 1


@pytest.mark.parametrize("shape", [(1, 1), (1, 30), (30, 1), (2, 3), (24, 31)])
def test_any_map_gives_blobs_of_its_vehicle_cells(shape: tuple[int, int]) -> None:
    dice = np.random.default_rng(7)
    for cell_m in (0.4, 2.0):
        grid = BEVGrid(0.0, shape[0] * cell_m, 0.0, shape[1] * cell_m, cell_m)
        for rounded in (0, 1, 6):
            occupancy = np.round(dice.uniform(0, 1, (3, *shape)) ** 0.3, rounded).astype(np.float32)
            colours = dice.integers(0, 256, (3, *shape)).astype(np.uint8)
            known = dice.uniform(size=(4, *shape)) < 0.9
            bev = BEVMap(grid, occupancy, known[:3], colours, known[3])
            labels, count = label_instances(bev, InstanceConfig())
            assert np.array_equal(np.unique(labels[labels > 0]), np.arange(1, count + 1))
            assert bev.on[VEHICLE][labels > 0].all()
            assert len(Detections.from_instances(measure_instances(bev, labels, count))) == count
