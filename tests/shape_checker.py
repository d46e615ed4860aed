"""What the test run checks shapes with: beartype, with an eye for shapes alone.

A whole number is a float, and arrays without a shape are anything: the values check those themselves, with errors of
their own that have tests of their own.
"""

from beartype import BeartypeConf, FrozenDict, beartype
from numpy.typing import ArrayLike

from appocc.checks import BoolArray, ByteArray, Float32Array, FloatArray, IntArray

_ANYTHING: FrozenDict[object, object] = FrozenDict(
    dict.fromkeys((ArrayLike, FloatArray, Float32Array, IntArray, ByteArray, BoolArray), object)
)
check = beartype(conf=BeartypeConf(is_pep484_tower=True, hint_overrides=_ANYTHING))
