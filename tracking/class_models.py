"""Class models: how the objects of each category move, and how far their detections may lie from a prediction."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass, field, fields

import numpy as np

from appocc.checks import BoolArray, FloatArray, IntArray
from tracking.compiled import compiled
from tracking.filtering.kalman import MotionConfig
from tracking.records import Records, append

# Weight of the configured measurement noise in detections, and the number of detections of a category after which
# earlier ones are forgotten.
_NOISE_PRIOR, _NOISE_MEMORY = 200.0, 2000.0
# Detections of low scores are less accurate: the noise is learnt for each of these intervals of log-odds, beginning
# from that of the category with a weight in detections.
_NOISE_EDGES, _NOISE_SHARED = np.array([-1.0, 0.0, 1.0, 2.0, 4.0]), 50.0
# Limits of the learnt factor on the variances of the noise.
_MIN_NOISE, _MAX_NOISE = 0.05, 4.0
# Squared innovations count up to this many variances: larger ones are wrong matches.
_MAX_INNOVATION_CHI2 = 9.0


@dataclass(frozen=True, kw_only=True)
class ClassModel:
    """Model of a category.

    Attributes:
        motion: motion and measurement model.
        gate_scale: factor on the gates in metres of all association stages.
        heading_weight: factor on the heading cost. At 0, headings are ignored, and there are no turns along arcs.
        prior_log_odds: prior log-odds that a track is an object of the category.
        prior_weight: weight of that prior, in independent detections. Detectors report the rarer classes more often
            beside an object of another class than on one of their own.
    """

    motion: MotionConfig = field(default_factory=MotionConfig)
    gate_scale: float = 1.0
    heading_weight: float = 1.0
    prior_log_odds: float = -2.0
    prior_weight: float = 4.0


_TWO_WHEELER = ClassModel(
    motion=MotionConfig(
        along_speed_std_mps=5.0,
        across_speed_std_mps=1.0,
        along_accel_psd_m2ps3=0.5,
        across_accel_psd_m2ps3=0.2,
        along_std_m=0.2,
        across_std_m=0.15,
    ),
    gate_scale=0.8,
    heading_weight=0.3,
)

# Models of nuScenes' and KITTI's classes. Other categories are vehicles: the default.
CLASS_MODELS: Mapping[str, ClassModel] = {
    "car": ClassModel(prior_weight=1.5),
    "pedestrian": ClassModel(
        motion=MotionConfig(
            along_speed_std_mps=1.2,
            across_speed_std_mps=1.2,
            along_accel_psd_m2ps3=0.2,
            across_accel_psd_m2ps3=0.2,
            along_std_m=0.15,
            across_std_m=0.15,
            stationary_psd=1.0,  # who stands may walk on
        ),
        gate_scale=0.5,
        heading_weight=0.0,
        prior_weight=1.5,
    ),
    "bicycle": _TWO_WHEELER,
    "motorcycle": _TWO_WHEELER,
}


# Names of the same classes in KITTI, COCO and other data sets, in lower case.
_SAME_CLASS = {
    "person": "pedestrian",
    "person_sitting": "pedestrian",
    "cyclist": "bicycle",
    "motorbike": "motorcycle",
    "motorcyclist": "motorcycle",
}


# The fields of `MotionConfig` and of `ClassModel` as a record.
CLASS_PARAMETERS = np.dtype([(each.name, np.float64) for each in (*fields(MotionConfig), *fields(ClassModel)[1:])])


class ClassTable:
    """Categories seen so far, numbered from 0, with their models and the noise learnt for them.

    Attributes:
        models: parameters by number, `CLASS_PARAMETERS`.
        noise_factors: (levels, K) learnt factors on the variances of positions, by score and number.
    """

    def __init__(self, models: Mapping[str, ClassModel], default: ClassModel) -> None:
        """Start with no categories; those without a model get the default one."""
        self._models, self._default = models, default
        self._numbers: dict[str, int] = {}
        self.models: Records = np.zeros(0, CLASS_PARAMETERS)
        # Sum of squared noise in units of the configured variance, and number of detections, by score and category.
        self._set_noise(np.zeros((2, len(_NOISE_EDGES) + 1, 0)))

    @property
    def names(self) -> tuple[str, ...]:
        """Names by number."""
        return tuple(self._numbers)

    def numbers(self, kinds: Sequence[str]) -> IntArray:
        """Return the numbers (N,) of N categories; new ones get the next."""
        for kind in [kind for kind in dict.fromkeys(kinds) if kind not in self._numbers]:
            self._numbers[kind] = len(self._numbers)
            model = self._model(kind)
            new = np.array([(*astuple(model.motion), *astuple(model)[1:])], CLASS_PARAMETERS)
            self.models = append(self.models, new)
            self._set_noise(np.pad(self._noise, ((0, 0), (0, 0), (0, 1))))
        return np.array([self._numbers[kind] for kind in kinds], dtype=np.int64)

    def _model(self, kind: str) -> ClassModel:
        """Return the model of a category under its own name, in lower case, or under the name that it has here."""
        plain = kind.lower()
        for name in (kind, plain, _SAME_CLASS.get(plain, plain)):
            if name in self._models:
                return self._models[name]
        return self._default

    def noise_level(self, log_odds: FloatArray) -> IntArray:
        """Return the intervals (N,) of log-odds (N,), each of which has a learnt noise of its own."""
        return np.asarray(_NOISE_EDGES.searchsorted(log_odds))

    def _set_noise(self, noise: FloatArray) -> None:
        """Set the learnt noise, and the factors by score and category that follow from it."""
        self._noise, self.noise_factors = noise, np.empty(noise.shape[1:])
        _forget_and_derive(self._noise, self.noise_factors)

    def learn_noise(
        self, found: Records, columns: IntArray, innovation_m: FloatArray, cov: FloatArray, use: BoolArray
    ) -> None:
        """Learn the measurement noise from innovations: one step of expectation maximisation.

        The expected squared noise of a detection, given its innovation, is e' S^-1 R S^-1 e + tr(R - R S^-1 R) in
        units of R (Shumway and Stoffer 1982, eq. 14), with S = P + R. R has the current factor.

        Args:
            found: detections, `DETECTION`.
            columns: (M,) indices of the detections to learn from.
            innovation_m: (M, 2) differences between detections and predictions.
            cov: (M, K, K) covariances of the predictions, first of their positions: P.
            use: (M,) which of them to learn from.
        """
        if len(columns):
            _learn(self._noise, self.noise_factors, found, columns, innovation_m, cov, use)
            _forget_and_derive(self._noise, self.noise_factors)


@compiled
def _forget_and_derive(noise: FloatArray, factors: FloatArray) -> None:
    """Forget the oldest detections in `noise` (2, levels, kinds), and write the factors (levels, kinds)."""
    levels, kinds = factors.shape
    for kind in range(kinds):
        total, count = 0.0, 0.0
        for level in range(levels):
            total += noise[0, level, kind]
            count += noise[1, level, kind]
        keep = _NOISE_MEMORY / max(count, _NOISE_MEMORY)
        shared = _NOISE_SHARED * (_NOISE_PRIOR + keep * total) / (_NOISE_PRIOR + keep * count)
        for level in range(levels):
            noise[0, level, kind] *= keep
            noise[1, level, kind] *= keep
            factor = (noise[0, level, kind] + shared) / (noise[1, level, kind] + _NOISE_SHARED)
            factors[level, kind] = min(max(factor, _MIN_NOISE), _MAX_NOISE)


@compiled
def _learn(
    noise: FloatArray,
    factors: FloatArray,
    found: Records,
    columns: IntArray,
    innovation_m: FloatArray,
    cov: FloatArray,
    use: BoolArray,
) -> None:
    """Add squared noises, in units of the configured variance, and their numbers to `noise` (2, levels, kinds)."""
    for k in range(len(columns)):
        if not use[k]:
            continue
        seen = found[columns[k]]
        rxx = seen.noise_m2[0, 0] - seen.surplus_noise_m2[0, 0]
        rxy = seen.noise_m2[0, 1] - seen.surplus_noise_m2[0, 1]
        ryy = seen.noise_m2[1, 1] - seen.surplus_noise_m2[1, 1]
        sxx, sxy, syy = cov[k, 0, 0] + rxx, cov[k, 0, 1] + rxy, cov[k, 1, 1] + ryy
        determinant = sxx * syy - sxy * sxy
        x, y = innovation_m[k]
        weighted_x, weighted_y = (x * syy - y * sxy) / determinant, (y * sxx - x * sxy) / determinant
        chi2 = weighted_x * x + weighted_y * y
        explained = weighted_x**2 * rxx + 2 * weighted_x * weighted_y * rxy + weighted_y**2 * ryy
        explained *= min(1.0, _MAX_INNOVATION_CHI2 / max(chi2, _MAX_INNOVATION_CHI2))
        trace = (syy * rxx - 2 * sxy * rxy + sxx * ryy) / determinant
        noise[0, seen.noise_level, seen.kind] += (explained + 2 - trace) / 2 * factors[seen.noise_level, seen.kind]
        noise[1, seen.noise_level, seen.kind] += 1.0
