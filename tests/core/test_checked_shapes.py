"""The test run checks the shapes that annotations promise."""

import numpy as np
import pytest
from jaxtyping import TypeCheckError

from appocc.geometry import apply, interpolate_pose
from appocc.groundtruth.visibility import ray_box_entry


def test_a_wrong_shape_is_caught() -> None:
    with pytest.raises(TypeCheckError, match="target_from_source"):
        apply(np.eye(3), np.zeros((2, 3)))


def test_sizes_named_alike_must_agree() -> None:
    with pytest.raises(TypeCheckError, match="poses"):
        interpolate_pose(np.arange(3.0), np.tile(np.eye(4), (2, 1, 1)), 0.5)


def test_right_shapes_pass() -> None:
    entry = ray_box_entry(np.zeros(3), np.array([[1.0, 0, 0]]), np.eye(4) + np.eye(4, k=3) * 5, np.ones(3))
    assert entry.tolist() == [4.0]
