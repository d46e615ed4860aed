"""Type aliases: paths, and arrays by shape. `Points3` is (..., 3); sizes with the same name (n) agree within a call.

Test runs with jaxtyping check the shapes at every call; elsewhere the aliases are plain numpy arrays.
"""

from __future__ import annotations

import os
import sys
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

# A path as public functions take it.
PathLike = str | os.PathLike[str]

if not TYPE_CHECKING and "jaxtyping" in sys.modules:
    from jaxtyping import Bool, Float, Int

    Transform = Float[np.ndarray, "4 4"]
    Transforms = Float[np.ndarray, "n 4 4"]
    Rotations = Float[np.ndarray, "*n 3 3"]
    Points2 = Float[np.ndarray, "*n 2"]
    Points3 = Float[np.ndarray, "*n 3"]
    List2 = Float[np.ndarray, "n 2"]
    List3 = Float[np.ndarray, "n 3"]
    Vector3 = Float[np.ndarray, "3"]
    Numbers = Float[np.ndarray, " n"]
    Flags = Bool[np.ndarray, " n"]
    Cells = Int[np.ndarray, "*n 2"]
    Corners = Float[np.ndarray, "m 8 3"]
    Cover = Float[np.ndarray, "x y"]
else:
    Transform = NDArray[np.float64]
    Transforms = NDArray[np.float64]
    Rotations = NDArray[np.float64]
    Points2 = NDArray[np.float64]
    Points3 = NDArray[np.float64]
    List2 = NDArray[np.float64]
    List3 = NDArray[np.float64]
    Vector3 = NDArray[np.float64]
    Numbers = NDArray[np.float64]
    Corners = NDArray[np.float64]
    Cover = NDArray[np.float64]
    Flags = NDArray[np.bool_]
    Cells = NDArray[np.int64]
