from __future__ import annotations

import numpy as np

from appocc.nuscenes.view_reduction import reduce_classes, reduce_view


def test_a_block_takes_its_commonest_class_and_that_class_s_median_depth() -> None:
    depth, kind = np.full((16, 24), 40.0, np.float32), np.ones((16, 24), np.uint8)
    depth[:8, :5], kind[:8, :5] = 10, 3  # 5 of 8 columns of the first block
    depth[:8, 8:11], kind[:8, 8:11] = 10, 3  # 3 of 8 of the second
    depth[8:, 16:], kind[8:, 16:] = np.inf, 0
    view = reduce_view(depth, kind)
    assert view.kind.tolist() == [[3, 1, 1], [1, 1, 0]]
    assert view.depth_m is not None
    assert view.depth_m.tolist() == [[10, 40, 40], [40, 40, np.inf]]
    assert view.depth_m.dtype == np.float16


def test_of_equal_classes_the_nearer_wins() -> None:
    depth, kind = np.full((8, 8), 30.0, np.float32), np.full((8, 8), 2, np.uint8)
    depth[4:], kind[4:] = 9, 7
    for view in (reduce_view(depth, kind), reduce_view(depth[::-1].copy(), kind[::-1].copy())):
        assert {name: array[0, 0] for name, array in view.arrays().items()} == {"kind": 7, "depth_m": 9}


def test_blocks_at_the_edge_are_cut() -> None:
    depth = np.arange(10 * 9, dtype=np.float32).reshape(10, 9)
    view = reduce_view(depth, np.zeros((10, 9), np.uint8))
    assert view.depth_m is not None
    assert view.depth_m.shape == (2, 2)
    assert view.depth_m[1, 1] in depth[8:, 8:]
    assert view.depth_m[0, 0] == np.sort(depth[:8, :8].ravel())[31]


def test_classes_alone_are_reduced_to_the_commonest() -> None:
    kind = np.full((10, 16), 255, np.uint8)
    kind[:8, :5], kind[:8, 8:11] = 3, 3  # 5 and 3 of 8 columns
    kind[8:] = 7
    view = reduce_classes(kind)
    assert view.kind.tolist() == [[3, 255], [7, 7]]
    assert view.depth_m is None
