"""The command `appocc`, also `python -m appocc`: starts `cli`, unless a package of appocc is shadowed."""

from __future__ import annotations

import sys
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

HOME = Path(__file__).resolve().parents[1]
PACKAGES = ("tracking", "grounding", "cli")


def run() -> None:
    """Entry point of the console script; exit code 2 if another module shadows a package of appocc."""
    for name in PACKAGES:
        place = _place(name)
        if place != HOME / name:
            got = f"{place} hides it" if place else "there is none"
            print(f"error: expected the package '{name}' of appocc in {HOME}, but {got}: {_ADVICE}", file=sys.stderr)
            sys.exit(2)
    # Imported by name, because no module of the core may depend on `cli`.
    import_module("cli.main").run()


_ADVICE = "rename that, start in another folder, or look at PYTHONPATH"


def _place(name: str) -> Path | None:
    """Return the file or folder that `import name` would load, without importing it."""
    spec = find_spec(name)
    if spec is None:
        return None
    place = next(iter(spec.submodule_search_locations or ()), spec.origin)
    return None if place is None else Path(place).resolve()


if __name__ == "__main__":
    run()
