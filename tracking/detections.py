"""Detections of vehicles in one frame, from any source: the input type of the tracker."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from appocc.bevmap import VEHICLE, BEVMap
from appocc.boxes import LARGEST_M
from appocc.checks import BoolArray, FloatArray, IntArray, as_array, check_finite, check_place, check_shape, frozen
from appocc.colours import lab_from_rgb
from appocc.errors import ShapeError
from appocc.geometry import footprints
from appocc.objects import BEVObjects
from tracking.compiled import compiled
from tracking.field_of_view import CircularView, FieldOfView, GridView
from tracking.instances.instances import InstanceConfig, Instances, find_instances
from tracking.neighbours import find_neighbours

# Probabilities are clipped to these log-odds, because 0 and 1 have no finite ones.
MAX_LOG_ODDS = 12.0
# Limit of given log-odds, such as detector scores, so that sums do not overflow.
_MAX_GIVEN_LOG_ODDS = 1e9
# Means of sRGB may exceed 255 by rounding.
_ROUNDING = 1e-6
# One category for all vehicles: a track keeps its id if the predicted class changes from car to truck.
_VEHICLE = "vehicle"
# Maximum radius of duplicate suppression: half the width of the widest vehicle.
_MAX_DUPLICATE_RADIUS_M = 2.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Detections:
    """N detections in one frame, in the ego frame, metres and radians.

    Attributes:
        ground_m: (N, 3) points on the ground below the centres.
        yaw_rad: (N,) direction of the long axis; if not `heading_known`, it may be off by pi.
        heading_known: (N,) whether the yaw distinguishes front and rear.
        size_m: (N, 3) width, length, height; the height is NaN if unknown.
        log_odds: (N,) log-odds of being a vehicle.
        kind: N categories; tracks only take detections of their own category.
        rgb: (N, 3) mean sRGB, 0..255; NaN if unknown.
        lab: (N, 3) robust CIELAB of the paint, used for association; NaN if unknown.
        velocity_mps: (N, 2) measured velocities over ground, in the axes of the ego; NaN if unknown.
        truncated: (N,) whether the vehicle extends beyond the field of view.
        view: field of view of the detector.
    """

    ground_m: FloatArray
    yaw_rad: FloatArray
    heading_known: BoolArray
    size_m: FloatArray
    log_odds: FloatArray
    kind: tuple[str, ...]
    rgb: FloatArray
    lab: FloatArray
    velocity_mps: FloatArray
    truncated: BoolArray
    view: FieldOfView

    def __post_init__(self) -> None:
        """Check shapes and values.

        Raises:
            ShapeError: if a shape differs, a required number is not finite, a position is farther than any on Earth,
                a size is not positive, a colour is outside 0..255, a category is no name, or the view is none.
        """
        if not isinstance(self.view, FieldOfView):
            raise ShapeError(f"detections view: expected a view such as CircularView(50.0), got {self.view!r}")
        n = len(self.ground_m)
        for name, (width, kind) in _ARRAYS.items():
            # A copy of the caller's array, or of his list.
            array = _as_array(name, getattr(self, name), width, kind)
            check_shape(f"detections {name}", array, (n, *width))
            frozen(array)
            object.__setattr__(self, name, array)
        check_place("detections ground_m", self.ground_m)
        for name in ("yaw_rad", "log_odds"):
            check_finite(f"detections {name}", getattr(self, name))
        check_finite("detections width and length", self.size_m[:, :2])
        _check_values(self)
        object.__setattr__(self, "kind", _checked_names(self.kind))
        if len(self.kind) != n:
            raise ShapeError(f"detections kind: expected {n} names, got {len(self.kind)}")

    @classmethod
    def from_boxes(
        cls,
        ground_m: ArrayLike,
        yaw_rad: ArrayLike,
        size_m: ArrayLike,
        log_odds: ArrayLike,
        kind: str | Sequence[str],
        view: FieldOfView | None = None,
        *,
        rgb: ArrayLike | None = None,
        velocity_mps: ArrayLike | None = None,
    ) -> Detections:
        """Return detections from a box detector with known headings; arrays or lists as in `Detections`.

        Args:
            ground_m: (N, 3) points on the ground below the centres, or (N, 2) on flat ground.
            yaw_rad: (N,) headings.
            size_m: (N, 3) width, length, height.
            log_odds: (N,) log-odds of being a vehicle, see `log_odds_from_probability`.
            kind: N categories, or one for all.
            view: field of view of the detector; by default unlimited.
            rgb: (N, 3) mean sRGB, 0..255, NaN where unknown; by default unknown.
            velocity_mps: (N, 2) velocities, NaN where unknown; by default unknown.

        Raises:
            ShapeError: as in `Detections`, or if colours are 0..1.
        """
        ground = _as_array("ground_m", ground_m, (3,), np.float64)
        n = len(ground)
        if ground.shape == (n, 2):
            ground = np.pad(ground, ((0, 0), (0, 1)))
        unknown = np.full((n, 3), np.nan)
        colours = unknown if rgb is None else _as_array("rgb", rgb, (3,), np.float64)
        check_shape("detections rgb", colours, (n, 3))
        known = colours[np.isfinite(colours)]
        if (known % 1).any() and known.max() <= 1:
            raise ShapeError(f"detections rgb: expected sRGB 0..255, got 0..{known.max():g}")
        # `__post_init__` converts them.
        kinds = (kind,) * n if isinstance(kind, str) else kind
        as_given: dict[str, Any] = {"yaw_rad": yaw_rad, "size_m": size_m, "log_odds": log_odds, "kind": kinds}
        return cls(
            **as_given,
            ground_m=ground,
            heading_known=np.ones(n, np.bool_),
            rgb=colours,
            lab=unknown if rgb is None else lab_from_rgb(colours),
            velocity_mps=unknown[:, :2] if velocity_mps is None else np.asarray(velocity_mps, np.float64),
            truncated=np.zeros(n, np.bool_),
            view=CircularView() if view is None else view,
        )

    @classmethod
    def from_bev(cls, bev: BEVMap, config: InstanceConfig | None = None) -> Detections:
        """Return the detections of a map: all known objects, or the vehicle instances of a map without objects."""
        objects = bev.known_objects
        return cls.from_instances(find_instances(bev, config)) if objects is None else _from_objects(bev, objects)

    @classmethod
    def from_instances(cls, instances: Instances) -> Detections:
        """Return instances as detections on the ground plane, of category "vehicle", with unknown front."""
        n = len(instances)
        return cls(
            ground_m=np.pad(instances.centroid_m, ((0, 0), (0, 1))),
            yaw_rad=instances.yaw_rad,
            heading_known=np.zeros(n, np.bool_),
            size_m=np.stack([instances.width_m, instances.length_m, np.full(n, np.nan)], axis=1),
            log_odds=log_odds_from_probability(instances.confidence),
            kind=(_VEHICLE,) * n,
            rgb=instances.rgb,
            lab=instances.lab,
            velocity_mps=np.full((n, 2), np.nan),
            truncated=instances.touches_border,
            view=instances.view,
        )

    def __len__(self) -> int:
        """Number of detections."""
        return len(self.ground_m)

    def select(self, keep: BoolArray | IntArray) -> Detections:
        """Return the detections of a mask (N,) or of indices, in the same field of view."""
        indices = np.arange(len(self))[keep]
        chosen = {name: getattr(self, name)[indices] for name in _ARRAYS}
        return replace(self, **chosen, kind=tuple(self.kind[i] for i in indices))

    def duplicates(self) -> tuple[IntArray, IntArray]:
        """Return pairs of detections of one object: better (K,) and worse (K,), best pairs first.

        Two detections are duplicates if their centres are closer than half the smaller width. The one with the higher
        log-odds is better; of equal ones, the first.
        """
        half_m = np.minimum(self.size_m[:, 0] / 2, _MAX_DUPLICATE_RADIUS_M)
        one, other = find_neighbours(self.ground_m[:, :2], self.ground_m[:, :2], half_m)
        if len(one) == len(self):  # no neighbours but itself
            return one[:0], other[:0]
        rank = np.empty(len(self), dtype=np.int64)
        rank[np.argsort(-self.log_odds, kind="stable")] = np.arange(len(self))
        offset = self.ground_m[one, :2] - self.ground_m[other, :2]
        close = (rank[one] < rank[other]) & (np.hypot(offset[:, 0], offset[:, 1]) <= half_m[other])
        one, other = one[close], other[close]
        order = np.argsort(rank[one], kind="stable")
        return one[order], other[order]

    def resolve_duplicates(self) -> tuple[BoolArray, FloatArray]:
        """Resolve several detections of one object.

        Of duplicates of one category, the worse is suppressed. An object is of one category only: its detection of
        another category lowers the odds of this one by the probability of being wrong, and most those of the less
        likely category.

        Returns:
            (N,) detections that are kept, and (N,) log-odds of being an object of the category.
        """
        log_odds, kept = self.log_odds.copy(), np.ones(len(self), dtype=np.bool_)
        pairs = self.duplicates()
        for better, worse in zip(pairs[0].tolist(), pairs[1].tolist(), strict=True):
            if not (kept[better] and kept[worse]):
                continue
            if self.kind[better] == self.kind[worse]:
                kept[worse] = False
            else:
                log_odds[better] -= np.logaddexp(0.0, self.log_odds[worse])
                log_odds[worse] -= np.logaddexp(0.0, self.log_odds[better])
        return kept, log_odds

    def find_containing(self, xy_m: FloatArray) -> tuple[IntArray, IntArray]:
        """Find the detections whose boxes contain points (P, 2) of the ego frame.

        Returns:
            (K,), (K,) indices of points and of detections.
        """
        if not len(xy_m):
            return np.zeros(0, np.int64), np.zeros(0, np.int64)
        half_m = self.size_m / 2
        boxes, points = find_neighbours(self.ground_m[:, :2], xy_m, np.hypot(half_m[:, 0], half_m[:, 1]))
        if not len(boxes):
            return points, boxes
        inside = np.empty(len(boxes), np.bool_)
        _find_inside(points.copy(), boxes.copy(), xy_m, self.ground_m, self.yaw_rad, half_m, inside)
        return points[inside], boxes[inside]


@compiled
def _find_inside(
    points: IntArray,
    boxes: IntArray,
    xy_m: FloatArray,
    ground_m: FloatArray,
    yaw_rad: FloatArray,
    half_m: FloatArray,
    inside: BoolArray,
) -> None:
    """Write whether points (K,) are inside boxes (K,) with half sizes (N, 3) to `inside` (K,)."""
    for k in range(len(points)):
        point, box = points[k], boxes[k]
        x, y = xy_m[point, 0] - ground_m[box, 0], xy_m[point, 1] - ground_m[box, 1]
        cos, sin = np.cos(yaw_rad[box]), np.sin(yaw_rad[box])
        ahead, left = abs(x * cos + y * sin), abs(y * cos - x * sin)
        inside[k] = ahead <= half_m[box, 1] and left <= half_m[box, 0]


def _from_objects(bev: BEVMap, objects: BEVObjects) -> Detections:
    """Return objects as detections: vehicles of category "vehicle", the others of their kind.

    Log-odds are relative to the map's object threshold, which has 0.
    """
    known = bev.occupancy_valid[VEHICLE]
    view = GridView(bev.grid, None if known.all() else known)
    outlines = footprints(objects.centre_m[:, :2], objects.yaw_rad, objects.size_wlh_m[:, [1, 0]]).reshape(-1, 2)
    cut = ~view.sees(outlines) | view.blind(outlines)
    threshold = log_odds_from_probability(np.array([bev.object_threshold]))
    half_height_m = objects.size_wlh_m[:, 2:] / 2 * np.array([0.0, 0.0, 1.0])
    return Detections(
        ground_m=objects.centre_m - half_height_m,
        yaw_rad=objects.yaw_rad,
        heading_known=np.ones(len(objects), np.bool_),
        size_m=objects.size_wlh_m,
        log_odds=log_odds_from_probability(objects.score) - threshold,
        kind=tuple(
            _VEHICLE if vehicle else kind for kind, vehicle in zip(objects.kind, objects.are_vehicles, strict=True)
        ),
        rgb=objects.rgb,
        lab=lab_from_rgb(objects.rgb),
        velocity_mps=np.full_like(objects.velocity_mps, np.nan),
        truncated=np.asarray(cut.reshape(-1, 4).any(axis=1)),
        view=view,
    )


# Arrays of `Detections`: shape of an entry, and type.
_ARRAYS: dict[str, tuple[tuple[int, ...], type[np.generic]]] = {
    "ground_m": ((3,), np.float64),
    "yaw_rad": ((), np.float64),
    "heading_known": ((), np.bool_),
    "size_m": ((3,), np.float64),
    "log_odds": ((), np.float64),
    "rgb": ((3,), np.float64),
    "lab": ((3,), np.float64),
    "velocity_mps": ((2,), np.float64),
    "truncated": ((), np.bool_),
}


def _as_array(name: str, values: ArrayLike, width: tuple[int, ...], kind: type[np.generic]) -> NDArray[Any]:
    """Return a copy of values as an array; an empty list becomes an array of no entries of shape `width`.

    Raises:
        ShapeError: if they are no numbers.
    """
    array = as_array(f"detections {name}", values, kind)
    return array.reshape(0, *width) if array.shape == (0,) else array


def _check_values(detections: Detections) -> None:
    """Check for values at which sums overflow or logarithms fail."""
    size_m, certainty = detections.size_m, np.abs(detections.log_odds)
    if (size_m <= 0).any():
        raise ShapeError(f"detections: expected positive sizes, got {np.nanmin(size_m):g} m")
    if (size_m > LARGEST_M).any():
        raise ShapeError(f"detections: expected sizes up to {LARGEST_M:g} m, got {np.nanmax(size_m):g} m")
    if (certainty > _MAX_GIVEN_LOG_ODDS).any():
        raise ShapeError(f"detections log_odds: expected {_MAX_GIVEN_LOG_ODDS:.0e} at most, got {certainty.max():g}")
    for name in ("rgb", "lab", "velocity_mps"):
        if np.isinf(getattr(detections, name)).any():
            raise ShapeError(f"detections {name}: expected finite numbers, or NaN where unknown, got infinity")
    outside = (detections.rgb < -_ROUNDING) | (detections.rgb > 255 + _ROUNDING)
    if outside.any():
        raise ShapeError(f"detections rgb: expected sRGB 0..255, got {detections.rgb[outside][0]:g}")


def _checked_names(kind: object) -> tuple[str, ...]:
    """Return names of categories as a tuple.

    Raises:
        ShapeError: if one is no text, or empty.
    """
    names = tuple(kind) if isinstance(kind, Iterable) and not isinstance(kind, str) else (kind,)
    for name in names:
        if not (isinstance(name, str) and name):
            raise ShapeError(f"detections kind: expected names of classes, got {name!r}")
    return names


def log_odds_from_probability(probability: ArrayLike) -> FloatArray:
    """Return the log-odds of probabilities, clipped to `MAX_LOG_ODDS`.

    Raises:
        ShapeError: if one is not in 0..1; scores of another unit may be log-odds already.
    """
    given = np.asarray(probability, dtype=np.float64)
    if not ((given >= 0) & (given <= 1)).all():
        wrong = given[~((given >= 0) & (given <= 1))]
        raise ShapeError(f"probability: expected numbers in 0..1, got {wrong.flat[0]:g}")
    lowest = 1 / (1 + np.exp(MAX_LOG_ODDS))
    clipped = np.clip(given, lowest, 1 - lowest)
    return np.asarray(np.log(clipped / (1 - clipped)))


def probability_from_log_odds(log_odds: FloatArray | float) -> FloatArray:
    """Return the probabilities, 0..1, of log-odds."""
    return np.asarray(1 / (1 + np.exp(-np.asarray(log_odds, dtype=np.float64))))
