"""Maps of many moments: whole files, resumed where a run was interrupted, with a picture of each."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from appocc.bevmap import BEVMap, is_truth
from appocc.checks import FloatArray
from appocc.errors import DataError
from appocc.files import write_image
from appocc.inference.inputs import Moment
from appocc.inference.predictor import Predictor
from appocc.provenance import Record, add_record
from appocc.visualization.predictions import figure

PICTURES = "pictures"


class Summary(NamedTuple):
    """What a run did.

    Attributes:
        made: maps that were made.
        kept: maps that were there already.
        dead: by channel, in how many frames it was left out, and why the first time.
        stale: of the maps that were made, how many were there already, by the reason why they were made anew.
    """

    made: int
    kept: int
    dead: dict[str, tuple[int, str]]
    stale: dict[str, int]


def infer(
    moments: Sequence[Moment],
    predictor: Predictor,
    out: Path,
    places_of: Callable[[BEVMap], FloatArray],
    advance: Callable[[float], None],
) -> Summary:
    """Write `out/TOKEN.npz` and `out/pictures/TITLE.png` of every moment; maps of the same inputs are kept.

    Args:
        moments: what is predicted.
        predictor: the network.
        out: folder of the maps.
        places_of: centroids (N, 2) of the vehicles of a map, ego frame, which the picture labels.
        advance: called with the number of moments done.

    Raises:
        DataError: if an image has another size than its rig says, a moment has no living camera, or `out` cannot be
            written or holds the truth.
    """
    if is_truth(str(out.resolve())):
        raise DataError(f"{out}: maps in a folder of this name count as the truth; name another one")
    made = kept = 0
    dead: dict[str, tuple[int, str]] = {}
    stale: Counter[str] = Counter()
    record = Record(out)
    for moment in moments:
        path, picture, parts = out / f"{moment.token}.npz", out / PICTURES / f"{moment.title}.png", moment.parts()
        reason = _why_stale(path, predictor) or (path.is_file() and record.why_stale(moment.token, parts))
        if path.is_file() and picture.is_file() and not reason:
            kept += 1
        else:
            stale.update([reason] if reason else [])
            view = moment.read()
            for channel, reason in view.dead.items():
                times, first = dead.get(channel, (0, reason))
                dead[channel] = (times + 1, first)
            bev, seen = predictor(view.frame)
            # The map comes last, so that it is never without its picture.
            write_image(picture, figure(view.frame, bev, places_of(bev)))
            bev.save(path, {"seen": seen})
            add_record(out, moment.token, parts)
            made += 1
        advance(1)
    record.tidy()
    return Summary(made, kept, dead, dict(stale))


def _why_stale(path: Path, predictor: Predictor) -> str:
    """Why a map that is there is none of these weights and this setting; '' if it is one, or none is there.

    Raises:
        DataError: if it was not predicted: a truth must not be replaced.
    """
    if not path.is_file():
        return ""
    try:
        meta = BEVMap.load(path).meta
    except DataError:
        return "damaged"
    if meta.get("source", "predicted") != "predicted" or "sources" in meta:
        raise DataError(f"{path}: expected a predicted map or none, got a truth; name another folder")
    if meta.get("weights") != predictor.weights.as_meta():
        return "weights changed"
    return "" if meta.get("setting") == predictor.model.setting.name else "setting changed"
