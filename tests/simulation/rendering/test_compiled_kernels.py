"""Compiled kernels on disk."""

from __future__ import annotations

import importlib.util
import pickle
from pathlib import Path
from types import ModuleType

import numba
import pytest

SOURCE = "def twice(x):\n    return 2 * x\n"


def loaded(path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_an_index_that_refers_to_removed_modules_is_replaced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # Numba reads the variable at its import, and again when a variable of its own has changed.
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path / "cache"))
    from appocc.simulation.rendering.compiled import kernel

    path = tmp_path / "small.py"
    path.write_text(SOURCE)
    assert kernel(loaded(path).twice)(3.0) == 6.0
    (index,) = tmp_path.rglob("*.nbi")
    written = index.read_bytes()
    index.write_bytes(pickle.dumps(numba.__version__, protocol=-1) + b"cappocc.gone\nThing\n.")
    assert kernel(loaded(path).twice)(3.0) == 6.0
    assert index.read_bytes()[: len(written) // 4] == written[: len(written) // 4]
