"""Objects of maps: checked, stored with the map, and read back."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_map import Car, map_of
from made_objects import made_object, together

from appocc.bevmap import VEHICLE, BEVMap
from appocc.errors import DataError, ShapeError
from appocc.objects import BEVObjects

CAR_AND_PERSON = together(
    made_object("pedestrian", 5.0, 3.0),
    made_object("car", 10.0, 0.0, rgb=(200, 10, 10), velocity_mps=(np.nan, np.nan)),
)


def with_objects(objects: BEVObjects | None = CAR_AND_PERSON) -> BEVMap:
    return replace(map_of([Car(10.0, 0.0)]), objects=objects)


@pytest.mark.parametrize("objects", [CAR_AND_PERSON, CAR_AND_PERSON.select(np.zeros(2, np.bool_))])
def test_objects_come_back_exactly(tmp_path: Path, objects: BEVObjects) -> None:
    with_objects(objects).save(tmp_path / "a.npz")
    found = BEVMap.load(tmp_path / "a.npz").objects
    assert found is not None
    assert found.kind == objects.kind
    for name in ("centre_m", "size_wlh_m", "yaw_rad", "velocity_mps", "rgb", "score"):
        np.testing.assert_array_equal(getattr(found, name), getattr(objects, name))
    replace(with_objects(found)).save(tmp_path / "b.npz")
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()


def test_a_map_without_objects_has_no_further_arrays(tmp_path: Path) -> None:
    with_objects(None).save(tmp_path / "a.npz")
    with np.load(tmp_path / "a.npz") as data:
        assert data.files == ["occupancy", "occupancy_valid", "appearance", "appearance_valid", "grid", "meta"]
    assert BEVMap.load(tmp_path / "a.npz").objects is None


def test_each_vehicle_cell_has_its_object(tmp_path: Path) -> None:
    bev = with_objects()
    bev.save(tmp_path / "a.npz")
    with np.load(tmp_path / "a.npz") as data:
        assert data["instance"].dtype == np.int16
        # The person has no vehicle cells; the car, the second object, has those of the true map.
        np.testing.assert_array_equal(data["instance"], np.where(bev.on[VEHICLE], 1, -1))


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"object_score": None}, "no BEV map, .*object_score"),
        ({"object_score": np.array([2.0, 0.5])}, r"objects score: expected 0\.\.1, got 0\.5\.\.2"),
        ({"object_score": np.array(["a", "b"])}, "objects score: expected numbers"),
        ({"object_yaw_rad": np.zeros(3)}, r"objects yaw_rad: expected shape \(2\), got \(3,\)"),
        ({"object_yaw_rad": np.array([np.nan, 0])}, "objects yaw_rad: expected finite numbers"),
        ({"object_rgb": np.full((2, 3), np.inf)}, "objects rgb: expected finite numbers, or NaN where unknown"),
        ({"object_size_wlh_m": np.zeros((2, 3))}, "objects: expected positive sizes, got 0 m"),
        ({"object_kind": np.array(["car", "tram"])}, "objects kind: expected 2 names of car, .*, got tram"),
        ({"object_kind": np.zeros(2)}, "objects kind: expected a row of names, got float64"),
    ],
)
def test_objects_that_cannot_be_true_are_named_with_their_file(
    tmp_path: Path, changes: dict[str, Any], reason: str
) -> None:
    with_objects().save(tmp_path / "a.npz")
    with np.load(tmp_path / "a.npz") as data:
        arrays = {name: data[name] for name in data.files} | changes
    np.savez(tmp_path / "b.npz", **{name: array for name, array in arrays.items() if array is not None})
    with pytest.raises(DataError, match=rf"b\.npz: .*{reason}") as caught:
        BEVMap.load(tmp_path / "b.npz")
    assert "\n" not in str(caught.value)


def test_objects_where_no_camera_looks_are_unknown() -> None:
    valid = np.ones((3, 200, 200), np.bool_)
    valid[VEHICLE, :115] = False  # behind x = 6 m
    meta = {"thresholds": {"road": 0.5, "vehicle": 0.5, "lane": 0.5}}
    bev = replace(with_objects(), occupancy_valid=valid, meta=meta)
    assert bev.known_objects is not None
    assert bev.known_objects.kind == ("car",)
    guessed = bev.with_guesses().known_objects
    assert guessed is not None
    assert guessed.kind == ("pedestrian", "car")
    beyond = replace(bev, objects=together(made_object("car", 41.0, 50.0), made_object("car", -41.0, 0.0)))
    assert beyond.known_objects is not None
    assert beyond.known_objects.centre_m[:, 0].tolist() == [41.0]
    assert with_objects(None).known_objects is None


def test_detected_objects_have_the_score_of_the_map(tmp_path: Path) -> None:
    objects = together(made_object("car", 1.0, 0.0, score=0.4), made_object("bus", 9.0, 0.0, score=0.6))

    def kinds(**meta: Any) -> tuple[str, ...]:
        found = replace(with_objects(objects), meta=meta).detected_objects
        assert found is not None
        return found.kind

    assert kinds() == ("bus",)
    assert kinds(object_threshold=0.4) == ("car", "bus")
    assert with_objects(None).detected_objects is None
    replace(with_objects(objects), meta={"object_threshold": "high"}).save(tmp_path / "a.npz")
    with pytest.raises(DataError, match=r"a\.npz: .*object_threshold of a map: expected a share, got high"):
        BEVMap.load(tmp_path / "a.npz")


def test_which_objects_are_vehicles() -> None:
    kinds = ("car", "truck", "bus", "motorcycle", "bicycle", "pedestrian")
    objects = together(*(made_object(kind, 1.0, 2.0) for kind in kinds))
    assert objects.are_vehicles.tolist() == [True] * 4 + [False] * 2


def test_what_is_no_table_of_objects() -> None:
    with pytest.raises(ShapeError, match=r"objects kind: expected 1 names of car, .*, got plane"):
        replace(made_object("car", 0.0, 0.0), kind=("plane",))
    with pytest.raises(ShapeError, match="objects: expected positive sizes, got -1 m"):
        made_object("car", 0.0, 0.0, size_wlh_m=(-1.0, 2.0, 3.0))
