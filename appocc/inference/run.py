"""Maps of many moments: whole files, resumed where a run was interrupted, with a picture of each."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from appocc.bevmap import BEVMap
from appocc.checks import FloatArray
from appocc.errors import DataError
from appocc.files import write_image
from appocc.inference.moments import Moment
from appocc.inference.pictures import figure
from appocc.inference.predictor import Predictor

PICTURES = "pictures"


class Summary(NamedTuple):
    """What a run did.

    Attributes:
        made: maps that were made.
        kept: maps that were there already.
        dead: by channel, in how many frames it was left out, and why the first time.
    """

    made: int
    kept: int
    dead: dict[str, tuple[int, str]]


def infer(
    moments: Sequence[Moment],
    predictor: Predictor,
    out: Path,
    places_of: Callable[[BEVMap], FloatArray],
    advance: Callable[[float], None],
) -> Summary:
    """Write `out/TOKEN.npz` and `out/pictures/TITLE.png` of every moment; maps of the same weights are kept.

    Args:
        moments: what is predicted.
        predictor: the network.
        out: folder of the maps.
        places_of: centroids (N, 2) of the vehicles of a map, ego frame, which the picture labels.
        advance: called with the number of moments done.

    Raises:
        DataError: if an image has another size than its rig says, a moment has no living camera, or `out` cannot be
            written.
    """
    made = kept = 0
    dead: dict[str, tuple[int, str]] = {}
    for moment in moments:
        path, picture = out / f"{moment.token}.npz", out / PICTURES / f"{moment.title}.png"
        if picture.is_file() and _same(path, predictor):
            kept += 1
        else:
            view = moment.read()
            for channel, reason in view.dead.items():
                times, first = dead.get(channel, (0, reason))
                dead[channel] = (times + 1, first)
            bev, seen = predictor(view.frame)
            # The map comes last, so that it is never without its picture.
            write_image(picture, figure(view.frame, bev, places_of(bev)))
            bev.save(path, {"seen": seen})
            made += 1
        advance(1)
    return Summary(made, kept, dead)


def _same(path: Path, predictor: Predictor) -> bool:
    """Whether a whole map of the same weights and setting lies there."""
    if not path.is_file():
        return False
    try:
        meta = BEVMap.load(path).meta
    except DataError:  # whatever is wrong with it, it is made anew
        return False
    return bool(
        meta.get("weights") == predictor.weights.as_meta() and meta.get("setting") == predictor.model.setting.name
    )
