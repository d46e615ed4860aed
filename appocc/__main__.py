"""The command `appocc`, also as `python -m appocc`: starts `cli`, unless something hides a package of the suite."""

from __future__ import annotations

import sys
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

HOME = Path(__file__).resolve().parents[1]
PACKAGES = ("tracking", "grounding", "cli")


def run() -> None:
    """Entry point of the console script; exit code 2 where another module hides a package of the suite."""
    for name in PACKAGES:
        place = _place(name)
        if place != HOME / name:
            got = f"{place} hides it" if place else "there is none"
            print(f"error: expected the package '{name}' of appocc in {HOME}, but {got}: {_ADVICE}", file=sys.stderr)
            sys.exit(2)
    # By name: no module of the core depends on `cli`; this one only starts it.
    import_module("cli.main").run()


_ADVICE = "rename that, start in another folder, or look at PYTHONPATH"


def _place(name: str) -> Path | None:
    """The file or folder that `import name` would take, without importing it."""
    spec = find_spec(name)
    if spec is None:
        return None
    place = next(iter(spec.submodule_search_locations or ()), spec.origin)
    return None if place is None else Path(place).resolve()


if __name__ == "__main__":
    run()
