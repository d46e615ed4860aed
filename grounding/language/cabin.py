"""Wishes about the cabin and the lights, which no driving command fulfils: "turn the heating down"."""

from __future__ import annotations

import re

NOT_CONTROLLED = "the cabin and the lights are not controlled here: only the way is"

_THE = r"(?:(?:the|your|our|my|that|this|some|a) )?"
_WHOSE = r"(?:(?:front|back|rear|left|right|passenger|interior|reading|heated|my|driver's) )?"
_KNOBS = (
    rf"{_WHOSE}(?:heat|heating|heater|air ?con|air conditioning|a/?c|fan|temperature|radio|music|song|tunes?|volume"
    r"|sound|screen|sat ?nav|wipers?|hazards?|hazard lights|indicators?|blinkers?|headlights?|lights?|seats?"
    r"|windows?|sunroof)"
)
_OPENINGS = rf"{_WHOSE}(?:windows?|sunroof|doors?|boot|trunk|blinds?)"
_HOW = r"(?: (?:up|down|on|off|higher|lower|louder|quieter|back|forward))?"
_MUCH = (
    r"(?: (?:a (?:bit|little|notch|touch|tad|degree)(?: more)?|more|again|now|for (?:me|us)"
    r"|at (?:him|her|it|them|that \w+)))*"
)
_TURN = r"(?:turn|switch|put|pop|flick|crank|dial|dim|kill|cut|flash|mute|pause|adjust|move|recline)"
_WISH = re.compile(
    r"(?:(?:and|but|oh|ok|okay|then|also|just|please|(?:can|could|would|will) you(?: please| just)?) )*"
    rf"(?:{_TURN} {_THE}{_KNOBS}{_HOW}"
    rf"|(?:turn|switch|put|pop|crank|flick) (?:up|down|on|off) {_THE}{_KNOBS}"
    rf"|(?:open|close|shut|lock|unlock|(?:roll|wind|put) (?:up|down)|raise|lower) {_THE}{_OPENINGS}"
    rf"|(?:roll|wind) {_THE}{_OPENINGS} (?:up|down)"
    r"|play (?:the|some|a|my) (?:music|song|radio|tunes?)"
    r"|(?:indicate|signal)(?: (?:left|right|to the left|to the right))?"
    rf"){_MUCH}(?: (?:please|mate|love|thanks|thank you))*",
    re.IGNORECASE,
)
_JOINT = re.compile(r"(\s*(?:[,.;!?]+|\band then\b|\band\b|\bthen\b)\s*)")


def without_cabin(text: str) -> tuple[str, str] | None:
    """Return a text without its clauses that are wishes about the cabin, and these; None for a text without any."""
    parts = _JOINT.split(text)
    clauses, joints = parts[::2], parts[1::2]
    wishes = [clause.strip() for clause in clauses if _WISH.fullmatch(clause.strip())]
    if not wishes:
        return None
    left = ""
    for joint, clause in zip(["", *joints], clauses, strict=True):
        if clause.strip() and clause.strip() not in wishes:
            left += f"{joint if left else ''}{clause}"
    return left, ", ".join(wishes)
