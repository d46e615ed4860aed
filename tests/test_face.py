"""The public names of the packages."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import appocc
import grounding
import tracking


@pytest.mark.parametrize("package", [appocc, grounding, tracking])
def test_every_public_name_can_be_imported(package: ModuleType) -> None:
    for name in package.__all__:
        assert getattr(package, name) is not None
        assert name in dir(package)


@pytest.mark.parametrize("package", [appocc, grounding])
def test_type_checkers_see_the_same_names_in_the_same_modules(package: ModuleType) -> None:
    tree = ast.parse(Path(str(package.__file__)).read_text())
    block = next(node for node in tree.body if isinstance(node, ast.If))
    imported = {
        alias.name: node.module for node in block.body if isinstance(node, ast.ImportFrom) for alias in node.names
    }
    assert imported == package._MODULES
    assert sorted(imported) == sorted(package.__all__)


def test_an_unknown_name_is_an_attribute_error() -> None:
    unknown = "Nothing"
    with pytest.raises(AttributeError, match="module 'appocc' has no attribute 'Nothing'"):
        getattr(appocc, unknown)
    with pytest.raises(ImportError):
        exec("from appocc import Nothing")


def test_importing_the_package_imports_nothing_heavy() -> None:
    code = "import sys, appocc; sys.exit(any(name in sys.modules for name in ('numpy', 'torch', 'cv2', 'pydantic')))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_paths_may_be_strings(tmp_path: Path) -> None:
    grid = appocc.BEVGrid(0, 2, -1, 1, 0.5)
    path = str(tmp_path / "bev" / "mine" / "t.npz")
    known = np.ones((3, 4, 4), np.bool_)
    bev = appocc.BEVMap(grid, np.zeros((3, 4, 4), np.float32), known, np.zeros((3, 4, 4), np.uint8), known[0])
    bev.save(path)
    assert appocc.BEVMap.load(path).grid == appocc.load_map(str(tmp_path), "mine", "t").grid == grid
    appocc.write_image(str(tmp_path / "i.png"), np.zeros((2, 3, 3), np.uint8))
    assert appocc.read_image(str(tmp_path / "i.png")).shape == (2, 3, 3)
    assert len(appocc.read_rig("paper")) == 6
