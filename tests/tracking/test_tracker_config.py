from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from appocc.errors import ShapeError
from tracking import MAPS, OBJECTS, Tracker, TrackerConfig
from tracking.association.costs import AssociationConfig
from tracking.class_models import CLASS_MODELS, ClassModel, ClassTable
from tracking.field_of_view import CircularView
from tracking.filtering.kalman import MotionConfig
from tracking.presets import PEOPLE_IN_IMAGE, PEOPLE_ON_GROUND
from tracking.track_table import LifecycleConfig

PAGE = Path(__file__).parents[2] / "docs" / "tracking.md"
OWNERS = {own.__name__: own for own in (TrackerConfig, LifecycleConfig, AssociationConfig)}
WRONG: list[tuple[Callable[[], Any], str]] = [
    (lambda: TrackerConfig(high_threshold=np.nan), "TrackerConfig.high_threshold: expected a number .*, got nan"),
    (lambda: TrackerConfig(low_threshold="a"), "TrackerConfig.low_threshold: expected a number .*, got 'a'"),  # type: ignore[arg-type]
    (lambda: TrackerConfig(colour_outlier_rate=2), "colour_outlier_rate: expected a number from 0 to 1, got 2"),
    (lambda: TrackerConfig(occlusion=1), "TrackerConfig.occlusion: expected bool, got 1"),  # type: ignore[arg-type]
    (lambda: TrackerConfig(lifecycle={}), "TrackerConfig.lifecycle: expected LifecycleConfig, got {}"),  # type: ignore[arg-type]
    (lambda: TrackerConfig(lifecycle=LifecycleConfig(lost_s=-1)), "LifecycleConfig.lost_s: expected a number from 0"),
    (lambda: TrackerConfig(lifecycle=LifecycleConfig(median_window=2.5)), "median_window: expected int, got 2.5"),  # type: ignore[arg-type]
    (lambda: TrackerConfig(association=AssociationConfig(max_cost=-1)), "AssociationConfig.max_cost: expected"),
    (lambda: TrackerConfig(classes={"car": 1}), r"TrackerConfig.classes\['car'\]: expected ClassModel, got 1"),  # type: ignore[dict-item]
    (
        lambda: TrackerConfig(classes={"car": ClassModel(motion=MotionConfig(along_std_m=np.nan))}),
        "MotionConfig.along_std_m: expected a number from 0 to inf, got nan",
    ),
    (lambda: CircularView(-5), "CircularView.range_m: expected a number from 0 to inf, got -5"),
    (lambda: CircularView(np.nan), "CircularView.range_m: expected a number from 0 to inf, got nan"),
]


@pytest.mark.parametrize(("make", "complaint"), WRONG)
def test_values_that_cannot_be_are_refused(make: Callable[[], Any], complaint: str) -> None:
    with pytest.raises(ShapeError, match=complaint):
        make()


def test_the_example_of_the_documentation() -> None:
    tuning = PAGE.read_text().partition("## Tuning")[2].partition("## Speed")[0]
    names: dict[str, Any] = {}
    exec(compile(tuning.split("```python\n")[1].split("```")[0], str(PAGE), "exec"), names)
    config = names["tracker"].config
    assert (config.lifecycle.coast_s, config.association.max_cost) == (0.8, 8.0)
    assert config.classes["car"].motion.along_accel_psd_m2ps3 == 2.0
    assert config.classes["pedestrian"] == CLASS_MODELS["pedestrian"]
    for row in re.findall(r"^\| (`.*?`) \|", tuning, re.MULTILINE):
        owner, *fields = re.findall(r"\w+", row)
        if owner != "ClassModel":
            assert all(hasattr(OWNERS[owner], name) for name in fields), row


@pytest.mark.parametrize("config", [TrackerConfig(), MAPS, OBJECTS, PEOPLE_IN_IMAGE, PEOPLE_ON_GROUND])
def test_numbers_may_be_of_numpy(config: TrackerConfig) -> None:
    changed = replace(config, high_threshold=np.float32(0.25), classes={})  # type: ignore[arg-type]
    assert Tracker(changed).config.high_threshold == 0.25


@pytest.mark.parametrize(
    ("kind", "model"),
    [
        ("Pedestrian", "pedestrian"),
        ("person", "pedestrian"),
        ("Person_sitting", "pedestrian"),
        ("Cyclist", "bicycle"),
        ("Car", "car"),
        ("MOTORBIKE", "motorcycle"),
        ("tram", None),
    ],
)
def test_names_of_other_data_sets_have_the_model_of_their_class(kind: str, model: str | None) -> None:
    table = ClassTable(CLASS_MODELS, ClassModel())
    table.numbers([kind, model or "vehicle"])
    assert table.names[0] == kind
    assert table.models[0] == table.models[1]


def test_an_own_model_goes_by_its_own_name() -> None:
    own = ClassModel(gate_scale=3.0)
    table = ClassTable({**CLASS_MODELS, "Person": own}, ClassModel())
    table.numbers(["Person", "person"])
    assert table.models["gate_scale"].tolist() == [3.0, CLASS_MODELS["pedestrian"].gate_scale]
