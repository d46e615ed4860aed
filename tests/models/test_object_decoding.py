"""Decoding of object heads: what perfect heads say comes back as the objects themselves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
from made_objects import made_object, together

from appocc.bevmap import VEHICLE
from appocc.checks import BoolArray, Float32Array, FloatArray
from appocc.grid import BEVGrid
from appocc.models.base import VELOCITY_UNIT_MPS, ObjectOutput
from appocc.models.object_decoding import LEAST_SCORE, MOST_PEAKS, decode_objects, fuse_vehicles, paint_objects
from appocc.objects import KINDS, BEVObjects
from appocc.training.batches.packed_objects import COLUMNS, KIND, RGB, VELOCITY, WLH, XY, YAW, Z
from appocc.training.object_losses import object_targets

GRID = BEVGrid(-16, 16, -12, 12, 0.4)
HALF = GRID.halved()
SEEN = np.ones(GRID.shape, np.bool_)


def rows_of(objects: BEVObjects) -> FloatArray:
    """Objects as training reads them."""
    rows = np.full((len(objects), COLUMNS), np.nan)
    rows[:, KIND] = [KINDS.index(kind) for kind in objects.kind]
    rows[:, XY], rows[:, Z], rows[:, WLH] = objects.centre_m[:, :2], objects.centre_m[:, 2], objects.size_wlh_m
    rows[:, YAW], rows[:, VELOCITY], rows[:, RGB] = objects.yaw_rad, objects.velocity_mps, objects.rgb
    return rows


def perfect_heads(objects: BEVObjects) -> ObjectOutput:
    """Head outputs as they are trained to be, sure of themselves at the centres, not around them."""
    rows = torch.from_numpy(rows_of(objects)).float()[None]
    targets = object_targets(rows, HALF)
    centre = torch.where(targets.heat == 1, 3.0, torch.logit((0.3 * targets.heat).clamp(min=1e-4)))
    return ObjectOutput(centre, *torch.split(targets.box.nan_to_num(nan=0.0), [2, 1, 3, 2, 2, 2], dim=1))


def decode(output: ObjectOutput, seen: BoolArray = SEEN, moving: bool = True) -> BEVObjects:
    return decode_objects(output, GRID, seen, moving)


def grey_map() -> tuple[Float32Array, FloatArray]:
    """Probabilities and colours of a map without vehicles."""
    return np.zeros((3, *GRID.shape), np.float32), np.full((3, *GRID.shape), 128.0)


def street() -> BEVObjects:
    return together(
        made_object("car", 3.3, -2.1, yaw_rad=0.7, velocity_mps=(6.0, 2.5)),
        made_object("bus", -6.0, 4.3, yaw_rad=-2.9, velocity_mps=(-9.0, 0.3)),
        made_object("truck", 10.2, 7.7, yaw_rad=3.1),
        made_object("motorcycle", -9.1, -6.5, yaw_rad=1.6),
        made_object("bicycle", 7.0, -9.0, velocity_mps=(0.5, -4.0)),
        made_object("pedestrian", 0.2, 9.3, velocity_mps=(0.0, 1.4)),
    )


def by_place(objects: BEVObjects) -> BEVObjects:
    return objects.select(np.argsort(objects.centre_m[:, 0]))


def test_perfect_heads_decode_to_the_objects() -> None:
    true, found = by_place(street()), by_place(decode(perfect_heads(street())))
    assert found.kind == true.kind
    np.testing.assert_allclose(found.centre_m, true.centre_m, atol=1e-4)
    np.testing.assert_allclose(found.size_wlh_m, true.size_wlh_m, rtol=1e-5)
    np.testing.assert_allclose(found.yaw_rad, true.yaw_rad, atol=1e-5)
    np.testing.assert_allclose(found.velocity_mps, true.velocity_mps, atol=1e-5)
    np.testing.assert_allclose(found.score, 1 / (1 + np.exp(-3)), rtol=1e-6)
    assert np.isnan(found.rgb).all()


def test_the_best_come_first() -> None:
    output = perfect_heads(street())
    for number, (x, y) in enumerate(street().centre_m[:, :2]):
        output.centre[0, :, *HALF.cell_of(np.array([x, y]))] += number / 10
    found = decode(output)
    assert (np.diff(found.score) < 0).all()
    assert found.kind[0] == "pedestrian"


def test_velocities_are_unknown_without_memory() -> None:
    moving, still = (decode(perfect_heads(street()), moving=moving) for moving in (True, False))
    assert np.isfinite(moving.velocity_mps).all()
    assert np.isnan(still.velocity_mps).all()
    np.testing.assert_array_equal(still.centre_m, moving.centre_m)


def test_no_objects_have_no_paint() -> None:
    assert len(paint_objects(decode(quiet_heads()), GRID, *grey_map(), SEEN)) == 0


# Paint ------------------------------------------------------------------------------------------------------------


def test_paint_is_the_colour_of_a_seen_cell_by_the_probabilities() -> None:
    car = made_object("car", 4.2, 0.2, size_wlh_m=(2.0, 4.4, 1.5))
    occupancy, rgb = grey_map()
    owner = car.vehicle_owner(GRID) == 0
    i, j = np.nonzero(owner)
    occupancy[VEHICLE][owner] = 0.9
    rgb[:, owner] = np.array([[200.0], [30.0], [40.0]])
    occupancy[VEHICLE, i[:10], j[:10]] = 0.0  # road within the box
    rgb[:, i[:10], j[:10]] = 90.0
    seen = SEEN.copy()
    rgb[:, i[-10:], j[-10:]], seen[i[-10:], j[-10:]] = 0.0, False  # guesses
    found = paint_objects(decode(perfect_heads(car)), GRID, occupancy, rgb, seen)
    np.testing.assert_allclose(found.rgb, [[200, 30, 40]], atol=0.1)


def test_people_have_no_paint_and_take_none_from_a_car() -> None:
    both = together(made_object("car", 4, 0), made_object("pedestrian", 4, 0.3), made_object("bicycle", -4, 0))
    found = paint_objects(decode(perfect_heads(both)), GRID, *grey_map(), SEEN)
    paint = dict(zip(found.kind, found.rgb.tolist(), strict=True))
    assert paint["car"] == pytest.approx([128] * 3)
    assert np.isnan(paint["pedestrian"] + paint["bicycle"]).all()


# Cells and boxes ----------------------------------------------------------------------------------------------------


def test_cells_in_a_sure_box_are_more_probable_and_others_are_less() -> None:
    car = made_object("car", 4.2, 0.2, size_wlh_m=(2.0, 4.4, 1.5))
    occupancy, _ = grey_map()
    occupancy[VEHICLE] = 0.3
    inside = car.vehicle_owner(GRID) == 0
    sure, doubtful = (replace(car, score=np.array([score])) for score in (0.9, 0.1))
    fused = fuse_vehicles(sure, GRID, occupancy)
    assert (fused[VEHICLE][inside] > 0.3).all()
    assert (fused[VEHICLE][~inside] < 0.3).all()
    assert (fused[VEHICLE][inside] > fuse_vehicles(doubtful, GRID, occupancy)[VEHICLE][inside]).all()
    np.testing.assert_array_equal(np.delete(fused, VEHICLE, 0), np.delete(occupancy, VEHICLE, 0))
    assert fused.dtype == occupancy.dtype


def test_certain_cells_and_scores_stay_finite() -> None:
    car = made_object("car", 4.2, 0.2)
    for value, score in ((0.0, 0.0), (1.0, 1.0)):
        occupancy = np.full((3, *GRID.shape), value, np.float32)
        fused = fuse_vehicles(replace(car, score=np.array([score])), GRID, occupancy)
        assert ((fused >= 0) & (fused <= 1)).all()


# Duplicates -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "other", "apart_m", "kept"),
    [
        ("car", "truck", 0.3, 1),
        ("car", "motorcycle", 0.9, 1),
        ("bus", "truck", 1.1, 1),
        ("car", "car", 2.0, 2),
        ("car", "truck", 1.9, 1),  # their bodies would overlap
        ("car", "truck", 2.8, 2),
        ("car", "bicycle", 0.3, 2),
        ("car", "pedestrian", 0.0, 2),
        ("bicycle", "pedestrian", 0.2, 2),
    ],
)
def test_vehicles_at_one_place_are_one(kind: str, other: str, apart_m: float, kept: int) -> None:
    both = together(made_object(kind, 4.1, 2.1), made_object(other, 4.1, 2.1 + apart_m))
    output = perfect_heads(both)
    output.centre[0, KINDS.index(kind)] += 0.5
    if apart_m < HALF.cell_m:  # the box of a cell is that of the nearest
        for each in both.centre_m[:, :2]:
            cell = HALF.cell_of(each)
            output.offset[0, :, *cell] = torch.from_numpy((each - HALF.centre_of(cell)) / HALF.cell_m)
    found = decode(output)
    assert found.kind == (kind, other)[:kept]


def test_a_duplicate_of_what_is_left_out_stays() -> None:
    both = together(made_object("car", 4.1, 1.9), made_object("truck", 4.1, 2.5))
    output, seen = perfect_heads(both), SEEN.copy()
    output.centre[0, KINDS.index("car")] += 0.5
    seen[:, : GRID.cell_of(np.array([4.1, 2.2]))[1]] = False
    assert decode(output, seen=seen).kind == ("truck",)


# Limits -----------------------------------------------------------------------------------------------------------


def test_centres_that_no_camera_sees_are_left_out() -> None:
    seen = np.broadcast_to((GRID.centres()[..., 0] > 0), GRID.shape).copy()
    found = decode(perfect_heads(street()), seen=seen)
    assert sorted(found.kind) == ["bicycle", "car", "pedestrian", "truck"]
    assert len(decode(perfect_heads(street()), seen=~SEEN)) == 0


def test_centres_that_lie_outside_are_left_out() -> None:
    output = perfect_heads(made_object("car", 15.7, 0))
    output.offset[:, 0] = 3.0
    assert len(decode(output)) == 0


def quiet_heads() -> ObjectOutput:
    """Head outputs that say nothing; their boxes are those of cars of a metre."""
    shapes = [len(KINDS), 2, 1, 3, 2, 2, 2]
    output = ObjectOutput(*(torch.zeros(1, n, *HALF.shape) for n in shapes))
    return output._replace(centre=torch.full_like(output.centre, -9.0))


def test_nothing_sure_is_nothing() -> None:
    assert len(decode(quiet_heads())) == 0
    nearly = quiet_heads()
    nearly.centre[0, 0, 5, 5] = float(np.log(LEAST_SCORE / (1 - LEAST_SCORE))) - 0.01
    assert len(decode(nearly)) == 0
    nearly.centre[0, 0, 5, 5] += 0.02
    assert len(decode(nearly)) == 1


def test_only_the_highest_peaks_are_objects() -> None:
    output = quiet_heads()
    places = np.stack(np.meshgrid(range(0, HALF.shape[0], 2), range(0, HALF.shape[1], 2)), -1).reshape(-1, 2)
    assert len(places) > MOST_PEAKS
    logits = torch.linspace(-2, 2, len(places))
    output.centre[0, 0, places[:, 0], places[:, 1]] = logits
    output.size[:] = float(np.log(0.5))
    found = decode(output)
    assert len(found) == MOST_PEAKS
    np.testing.assert_allclose(found.score.min(), torch.sigmoid(logits[-MOST_PEAKS]), rtol=1e-5)


@pytest.mark.parametrize("value", [-1e4, 0.0, 1e4])
def test_random_and_extreme_heads_give_objects_that_can_be(value: float) -> None:
    torch.manual_seed(0)
    output = quiet_heads()
    output = ObjectOutput(*(torch.randn_like(each) * 3 for each in output))._replace(
        size=torch.full_like(output.size, value) + torch.randn_like(output.size)
    )
    found = decode(output)
    assert 0 < len(found) <= MOST_PEAKS
    for name in ("centre_m", "size_wlh_m", "yaw_rad", "velocity_mps", "score"):
        assert np.isfinite(getattr(found, name)).all()
    assert found.size_wlh_m.min() >= 0.2 - 1e-9
    assert found.size_wlh_m.max() <= 30 + 1e-9
    assert GRID.contains(GRID.cell_of(found.centre_m[:, :2])).all()


@pytest.mark.parametrize(
    ("heading_deg", "axis_deg", "expected_deg"), [(100, 30, 30), (130, 30, -150), (-90, 80, -100)]
)
def test_the_heading_lies_along_the_axis_in_the_nearer_direction(
    heading_deg: float, axis_deg: float, expected_deg: float
) -> None:
    output = quiet_heads()
    output.centre[0, 0, 5, 5] = 4.0
    for name, angle in (("heading", np.radians(heading_deg)), ("axis", np.radians(2 * axis_deg))):
        getattr(output, name)[0, :, 5, 5] = 0.3 * torch.tensor([np.sin(angle), np.cos(angle)])
    np.testing.assert_allclose(np.degrees(decode(output).yaw_rad), [expected_deg], atol=1e-4)


def test_the_unit_of_velocities() -> None:
    output = quiet_heads()
    output.centre[0, 0, 5, 5], output.velocity[0, 0] = 4.0, 0.7
    np.testing.assert_allclose(decode(output).velocity_mps, [[0.7 * VELOCITY_UNIT_MPS, 0]], rtol=1e-6)
