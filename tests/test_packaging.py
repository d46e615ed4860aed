"""The sdist, the wheel built from it, and the declared dependencies."""

from __future__ import annotations

import ast
import os
import re
import shutil
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from collections.abc import Iterator
from importlib.metadata import packages_distributions
from pathlib import Path
from typing import Any, NamedTuple

import pytest

ROOT = Path(__file__).parents[1]
ONLY_IN_TESTS = "jaxtyping"  # imported only if the test run has loaded it
SHIPPED = ("appocc", "tracking", "grounding", "cli")
FOLDERS = (*SHIPPED, "tests", "benchmarks", "docs", "configs")
FILES = ("LICENSE", "README.md", "CHANGELOG.md", "CONTRIBUTING.md", "Makefile", "constraints.txt", "pyproject.toml")
PROJECT: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


class Built(NamedTuple):
    """An sdist, unpacked, and a wheel built from it, unpacked."""

    sdist: Path
    wheel: Path


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Built:
    """Build with the backend itself: without network, with setuptools only."""
    folder = tmp_path_factory.mktemp("built")
    for name in FOLDERS:
        shutil.copytree(ROOT / name, folder / "clone" / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in (*FILES, "MANIFEST.in"):
        shutil.copy(ROOT / name, folder / "clone")
    backend = "import sys; from setuptools.build_meta import *; {}(sys.argv[1])"
    for hook, source in (("build_sdist", "clone"), ("build_wheel", "sdist")):
        command = [sys.executable, "-c", backend.format(hook), str(folder)]
        subprocess.run(command, cwd=folder / source, check=True, capture_output=True)
        if hook == "build_sdist":
            with tarfile.open(next(folder.glob("*.tar.gz"))) as archive:
                archive.extractall(folder, filter="data")
            next(folder.glob("appocc-*[0-9]")).rename(folder / "sdist")
    with zipfile.ZipFile(next(folder.glob("*.whl"))) as archive:
        archive.extractall(folder / "wheel")
    return Built(folder / "sdist", folder / "wheel")


def _files(folder: Path, pattern: str = "*") -> set[str]:
    found = folder.rglob(pattern)
    return {str(path.relative_to(folder)) for path in found if path.is_file() and "__pycache__" not in path.parts}


def test_the_wheel_contains_all_files_of_the_packages(built: Built) -> None:
    for package in SHIPPED:
        assert _files(built.wheel / package) == _files(ROOT / package)
    assert {path.name for path in built.wheel.iterdir() if not path.name.endswith(".dist-info")} == {*SHIPPED}
    assert [path.name for path in built.wheel.glob("*.dist-info/licenses/*")] == ["LICENSE"]


def test_the_sdist_contains_the_files_of_the_readme(built: Built) -> None:
    for folder in FOLDERS:
        assert _files(built.sdist / folder) == _files(ROOT / folder)
    assert {"tests/conftest.py", "tests/fixtures/vehicle_colours_pandaset_002.json"} <= _files(built.sdist)
    for name in FILES:
        assert (built.sdist / name).read_bytes() == (ROOT / name).read_bytes()
    assert os.access(built.sdist / "configs" / "release.sh", os.X_OK)


def test_a_training_starts_from_the_wheel(built: Built, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "appocc", "train", "small", "train.lr=high"]
    environment = {**os.environ, "PYTHONPATH": str(built.wheel)}
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    shipped = built.wheel / "appocc" / "training" / "configs" / "small.yaml"
    assert done.returncode == 2, done.stderr
    assert done.stderr.startswith(f"error: {shipped} with train.lr=high: train.lr: expected a number")


def test_every_import_is_declared_and_every_dependency_imported() -> None:
    extras = PROJECT["optional-dependencies"]
    needed = _names(PROJECT["dependencies"])
    declared = needed.union(*(_names(lines) for extra, lines in extras.items() if extra != "dev"))
    distributions = packages_distributions()
    imported = {
        module: {_plain(name) for name in distributions.get(module, [module])}
        for package in SHIPPED
        for path in (ROOT / package).rglob("*.py")
        for module in _imports(path)
        if module not in (*SHIPPED, ONLY_IN_TESTS, *sys.stdlib_module_names)
    }
    assert {"torch", "cv2", "yaml"} <= imported.keys()
    assert [module for module, names in imported.items() if not names & declared] == []
    assert needed - set().union(*imported.values()) == set()


def _names(requirements: list[str]) -> set[str]:
    return {_plain(re.split(r"[^\w.-]", line)[0]) for line in requirements}


def _plain(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def _imports(path: Path) -> Iterator[str]:
    """Yield the top-level names of all modules that a file imports."""
    for node in ast.walk(ast.parse(path.read_text())):
        names: list[str] = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and not node.level:
            names = [node.module or ""]
        elif isinstance(node, ast.Call) and ast.unparse(node.func).split(".")[-1] in ("import_module", "package"):
            names = [
                word.value for word in node.args if isinstance(word, ast.Constant) and isinstance(word.value, str)
            ]
        yield from (name.split(".")[0] for name in names)
