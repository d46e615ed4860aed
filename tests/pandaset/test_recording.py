from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from appocc.boxes import is_vehicle
from appocc.errors import DataError, ShapeError
from appocc.nuscenes.writer import CATEGORIES
from appocc.pandaset.classes import attribute_of, category_of
from appocc.pandaset.recording import (
    Cuboid,
    PandaFrame,
    PandaImage,
    PandaSweep,
    Recording,
    RoadRaster,
    drop_duplicate_cuboids,
)


def cuboid(track: str, sensor: int = -1, sibling: str | None = None) -> Cuboid:
    return Cuboid(
        track=track,
        label="Car",
        centre_world_m=np.zeros(3),
        size_lwh_m=np.array([4.0, 2.0, 1.5]),
        yaw_world_rad=0.0,
        motion=None,
        sensor=sensor,
        sibling=sibling,
    )


def test_duplicates_are_dropped_only_with_their_sibling() -> None:
    alone, main, twin = cuboid("a"), cuboid("b", 0, "c"), cuboid("c", 1, "b")
    orphan, unpaired = cuboid("d", 1, "gone"), cuboid("e", 1, None)
    kept = drop_duplicate_cuboids((alone, twin, main, orphan, unpaired))
    assert [c.track for c in kept] == ["a", "b", "d", "e"]


def test_siblings_that_are_cut_short() -> None:
    token = "d0da2ae7-b5bb-4489-8844-5dcc06ddae67"
    main, twin, alike = cuboid(token, 0), cuboid("t", 1, token[:-2]), cuboid(token[:-2] + "99", 0)
    assert drop_duplicate_cuboids((main, twin)) == (main,)
    assert drop_duplicate_cuboids((main, twin, alike)) == (main, twin, alike)
    start = cuboid("s", 1, token[:4])
    assert drop_duplicate_cuboids((main, start)) == (main, start)


def frame(index: int, time_s: float) -> PandaFrame:
    image = PandaImage(Path("a.jpg"), time_s, np.eye(4))
    return PandaFrame(index, time_s, np.eye(4), {"CAM_FRONT": image}, (), None)


def recording(*frames: PandaFrame) -> Recording:
    return Recording("x", frames, {"CAM_FRONT": np.eye(3)}, {7: "Road"}, None, "")


def test_invalid_recordings_are_refused() -> None:
    good = recording(frame(0, 1.0), frame(1, 1.1))
    assert len(good.frames) == 2
    with pytest.raises(DataError, match="sequence x: no frames"):
        recording()
    for times in ((1.0, 1.0), (1.1, 1.0)):
        with pytest.raises(DataError, match="the times of the frames do not increase"):
            recording(*(frame(i, t) for i, t in enumerate(times)))
    with pytest.raises(DataError, match="CAM_FRONT has images but no intrinsic matrix"):
        replace(good, intrinsics={})
    with pytest.raises(ShapeError, match="CAM_FRONT intrinsic"):
        replace(good, intrinsics={"CAM_FRONT": np.eye(4)})
    with pytest.raises(DataError, match=r"expected point labels 0\.\.255, got 256"):
        replace(good, label_names={256: "Road"})
    with pytest.raises(DataError, match="PandaSet has no class 'Rode'; the nearest is 'Road'"):
        replace(good, label_names={7: "Rode"})


def test_invalid_parts_are_refused() -> None:
    with pytest.raises(ShapeError, match=r"a\.jpg world_from_cam"):
        PandaImage(Path("x/a.jpg"), 0.0, np.zeros((4, 4)))
    with pytest.raises(ShapeError, match=r"a\.jpg time"):
        PandaImage(Path("x/a.jpg"), np.nan, np.eye(4))
    with pytest.raises(ShapeError, match="frame 3 world_from_ego"):
        PandaFrame(3, 0.0, np.zeros((4, 4)), {}, (), None)
    with pytest.raises(ShapeError, match="frame 3 time"):
        PandaFrame(3, np.inf, np.eye(4), {}, (), None)
    for name, change in (
        ("centre", {"centre_world_m": np.zeros(2)}),
        ("size", {"size_lwh_m": np.array([1.0, np.nan, 1])}),
        ("size: expected positive", {"size_lwh_m": np.array([1.0, -1, 1])}),
        ("yaw", {"yaw_world_rad": np.nan}),
    ):
        with pytest.raises(ShapeError, match=f"cuboid a {name}"):
            replace(cuboid("a"), **change)


def test_invalid_sweeps_are_refused() -> None:
    points, bytes_ = np.zeros((3, 3)), np.zeros(3, np.uint8)
    assert PandaSweep(points, bytes_, None).labels is None
    for wrong in (
        (points[:2], bytes_, bytes_),
        (points, bytes_[:2], None),
        (points, bytes_, bytes_.astype(np.int64)),
        (points * np.nan, bytes_, bytes_),
        (points[:0], bytes_[:0], None),
    ):
        with pytest.raises(ShapeError, match="expected"):
            PandaSweep(*wrong)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"label": np.zeros(5, np.uint8)}, r"label: expected shape"),
        ({"label": np.zeros((0, 5), np.uint8)}, "label: expected some cells"),
        ({"origin_m": (float("nan"), 0.0)}, "origin: expected finite"),
        *(({"cell_m": size}, "resolution: expected") for size in (0.25, 0.04, 0.0, -0.2, float("nan"), 1e9, 10.1)),
    ],
)
def test_invalid_road_rasters_are_refused(change: dict[str, Any], message: str) -> None:
    good = RoadRaster(np.zeros((2, 3), np.uint8), (0.0, 0.0), 0.2)
    assert good.scale == 2
    with pytest.raises(ShapeError, match=message):
        replace(good, **change)


# As the design says: PandaSet's classes that are vehicles.
VEHICLES = (
    "Car",
    "Pickup Truck",
    "Medium-sized Truck",
    "Semi-truck",
    "Towed Object",
    "Motorcycle",
    "Other Vehicle - Construction Vehicle",
    "Emergency Vehicle",
    "Bus",
)


def test_classes() -> None:
    assert all(is_vehicle(category_of(label)) for label in VEHICLES)
    for label in (
        "Bicycle",
        "Pedestrian",
        "Personal Mobility Device",
        "Motorized Scooter",
        "Cones",
        "Road Barriers",
        "Signs",
    ):
        assert not is_vehicle(category_of(label))
    assert category_of("Road") == category_of("Lane Line Marking") == "flat.driveable_surface"
    assert category_of("Driveway") == category_of("Sidewalk") == "flat.sidewalk"
    with pytest.raises(DataError, match="PandaSet has no class 'Car '; the nearest is 'Car'"):
        category_of("Car ")


@pytest.mark.realdata
def test_all_classes_of_the_recording_are_known(data_root: Path) -> None:
    import json

    names = json.loads((data_root / "pandaset_002/002/annotations/semseg/classes.json").read_text())
    assert len(names) == 42
    assert all(category_of(name) in CATEGORIES for name in names.values())


@pytest.mark.parametrize(
    ("label", "motion", "attribute"),
    [
        ("Car", "Parked", "vehicle.parked"),
        ("Bus", "Stopped", "vehicle.stopped"),
        ("Pickup Truck", "Moving", "vehicle.moving"),
        ("Car", None, ""),
        ("Car", "Flying", ""),
        ("Motorcycle", "Moving", ""),
        ("Bicycle", "Parked", ""),
        ("Pedestrian", "Moving", ""),
    ],
)
def test_attributes(label: str, motion: str | None, attribute: str) -> None:
    assert attribute_of(label, motion) == attribute
