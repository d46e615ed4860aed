"""Vehicle paints and clothing colours as on real streets: colour shares and their spread."""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from appocc.errors import NotFoundError
from appocc.simulation.actors.materials import Colour
from appocc.simulation.traffic import Actor

# sRGB of typical paints of a colour word: (weight, centre, spread along the brightness, spread of the hue).
_TypicalPaint = tuple[float, Colour, float, float]
_PAINTS: dict[str, tuple[_TypicalPaint, ...]] = {
    "white": ((3.0, (236, 237, 236), 5.0, 1.5), (1.0, (226, 225, 219), 5.0, 2.0)),
    "black": ((2.0, (20, 21, 23), 5.0, 1.5), (1.0, (34, 35, 39), 5.0, 2.0)),
    "grey": ((2.0, (94, 97, 101), 10.0, 2.0), (1.0, (74, 77, 82), 7.0, 2.5), (0.6, (112, 113, 112), 8.0, 2.0)),
    "silver": ((2.0, (172, 175, 178), 9.0, 2.0), (0.6, (160, 160, 156), 8.0, 2.0)),
    "blue": ((2.0, (28, 58, 122), 9.0, 6.0), (1.0, (36, 92, 168), 10.0, 7.0), (0.6, (72, 128, 190), 9.0, 6.0)),
    "red": ((2.0, (164, 22, 32), 10.0, 6.0), (1.0, (122, 18, 30), 8.0, 5.0)),
    "green": ((2.0, (30, 84, 56), 8.0, 6.0), (1.0, (74, 132, 76), 9.0, 7.0)),
    "brown": ((2.0, (92, 64, 46), 8.0, 4.0), (1.0, (150, 122, 94), 8.0, 2.5)),
    "orange": ((1.0, (226, 108, 26), 9.0, 6.0),),
    "yellow": ((1.0, (232, 190, 36), 8.0, 6.0),),
    "purple": ((1.0, (92, 44, 112), 8.0, 6.0),),
    "pink": ((1.0, (234, 156, 182), 6.0, 4.0),),
}
# Shares of new and used cars by colour (manufacturers' yearly counts agree to a few percent).
_CARS = {
    **{"white": 0.34, "black": 0.21, "grey": 0.18, "silver": 0.09, "blue": 0.075, "red": 0.055},
    **{"green": 0.015, "brown": 0.015, "orange": 0.010, "yellow": 0.006, "purple": 0.004},
}
_VANS = {"white": 0.68, "grey": 0.09, "black": 0.07, "silver": 0.06, "blue": 0.05, "red": 0.03, "yellow": 0.02}
_TRUCKS = {
    **{"white": 0.60, "blue": 0.09, "red": 0.07, "yellow": 0.06, "green": 0.05, "silver": 0.05, "grey": 0.04},
    **{"brown": 0.02, "orange": 0.02},
}
_BUSES = {"red": 0.40, "white": 0.25, "blue": 0.15, "yellow": 0.10, "green": 0.10}
_MOTORCYCLES = {
    **{"black": 0.42, "red": 0.15, "blue": 0.12, "white": 0.12, "grey": 0.08, "green": 0.05},
    **{"orange": 0.03, "yellow": 0.03},
}
_BICYCLES = {
    **{"black": 0.38, "blue": 0.12, "white": 0.12, "red": 0.10, "grey": 0.10, "green": 0.07, "silver": 0.06},
    **{"orange": 0.03, "yellow": 0.02},
}
_CLOTHES = {
    **{"black": 0.34, "grey": 0.16, "blue": 0.17, "white": 0.10, "brown": 0.07, "red": 0.06, "green": 0.05},
    **{"yellow": 0.02, "pink": 0.02, "purple": 0.01},
}
_SHARES = {
    **{"car": _CARS, "van": _VANS, "truck": _TRUCKS, "bus": _BUSES},
    **{"motorcycle": _MOTORCYCLES, "bicycle": _BICYCLES, "pedestrian": _CLOTHES},
}


# Most buses of a town belong to one fleet.
_FLEET_SHARE = 0.85


@dataclass(frozen=True)
class ActorPaint:
    """The colour of an actor.

    Attributes:
        rgb: sRGB, 0..255.
        name: the colour word it was drawn from, one of `COLOUR_WORDS`.
    """

    rgb: Colour
    name: str


COLOUR_WORDS = tuple(_PAINTS)


def draw_paint(actor: Actor, seed: int, rare: float = 0.0) -> ActorPaint:
    """Draw the paint of a vehicle or of a pedestrian's jacket; it depends on seed, kind and name only.

    Args:
        actor: the vehicle or pedestrian.
        seed: random seed.
        rare: share of the vehicles whose colour word is drawn uniformly instead of by the shares of real streets.

    Raises:
        NotFoundError: if the kind has no paints.
    """
    if actor.kind not in _SHARES:
        raise NotFoundError(f"{actor.name}: there is no kind '{actor.kind}', only {', '.join(_SHARES)}")
    own = [seed, zlib.crc32(actor.name.encode())]
    if rare > 0 and actor.kind != "pedestrian":
        rng = np.random.default_rng([*own, *b"rare"])
        if rng.random() < rare:
            name = COLOUR_WORDS[int(rng.integers(len(COLOUR_WORDS)))]
            return ActorPaint(_vary(rng, _PAINTS[name]), name)
    rng = np.random.default_rng(own)
    if actor.kind == "bus" and rng.random() < _FLEET_SHARE:
        rng = np.random.default_rng([seed, *b"fleet"])
    shares = _SHARES[actor.kind]
    name = _draw_word(rng, list(shares), list(shares.values()))
    return ActorPaint(_vary(rng, _PAINTS[name]), name)


def draw_paints(actors: Sequence[Actor], seed: int, rare: float = 0.0) -> tuple[ActorPaint, ...]:
    """Draw the paints of a log's actors, in their order, see `draw_paint`."""
    return tuple(draw_paint(actor, seed, rare) for actor in actors)


def _draw_word(rng: np.random.Generator, words: list[str], shares: list[float]) -> str:
    return words[int(np.searchsorted(np.cumsum(shares) / np.sum(shares), rng.random(), side="right"))]


def _vary(rng: np.random.Generator, typical: tuple[_TypicalPaint, ...]) -> Colour:
    """Draw a colour near one of several typical paints: metallic flakes and age change brightness more than hue."""
    weights = np.array([weight for weight, *_ in typical])
    pick = int(np.searchsorted(np.cumsum(weights) / weights.sum(), rng.random(), side="right"))
    _, centre, spread, hue_spread = typical[pick]
    drawn = np.array(centre) + spread * np.clip(rng.normal(), -2, 2) + hue_spread * np.clip(rng.normal(size=3), -2, 2)
    red, green, blue = (int(v) for v in np.clip(np.rint(drawn), 4, 250))
    return red, green, blue
