"""What the environment has and lacks, as found in package metadata and the system."""

from __future__ import annotations

import os
import platform
import subprocess
import tempfile
from importlib import metadata
from pathlib import Path
from typing import Any

import pytest

from appocc import environment
from appocc.environment import Environment, Package, gpu, inspect_environment, memory, required_packages, version_of


@pytest.mark.parametrize(
    ("least", "version", "complaint"),
    [
        ("2.0", "2.4.6", ""),
        ("2.11", "2.13.0+cpu", ""),
        ("2.0", "2.0", ""),
        ("", "0.1.dev3", ""),
        ("2.10", "2.9.1", "x 2.9.1 is too old, at least 2.10 is needed"),
        ("2.0", None, "x is not installed"),
    ],
)
def test_what_is_wrong_with_a_package(least: str, version: str | None, complaint: str) -> None:
    assert Package("x", least, version).complaint == complaint


def test_requirements_are_parted_by_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(environment, "version_of", {"numpy": "2.4", "av": None}.get)
    lines = ["numpy>=2.0", "lark", 'av>=14; extra == "video"', "trackeval ; extra == 'dev'", "???"]
    required, extras = required_packages(lines)
    assert required == (Package("numpy", "2.0", "2.4"), Package("lark", "", None))
    assert extras == {"video": (Package("av", "14", None),), "dev": (Package("trackeval", "", None),)}


def test_versions_come_from_metadata() -> None:
    assert version_of("numpy") == metadata.version("numpy")
    assert version_of("no-such-package-anywhere") is None


def test_this_environment(tmp_path: Path) -> None:
    here = inspect_environment(tmp_path)
    assert here.cores >= 1
    assert here.free_disk_bytes > 0
    assert {"torch", "numpy", "typer"} <= {package.name for package in here.packages}
    assert "dev" in here.extras


def test_the_suite_run_from_a_folder_that_is_not_installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def nothing(name: str) -> Any:
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(metadata, "requires", nothing)
    monkeypatch.setattr(metadata, "version", nothing)
    here = inspect_environment(tmp_path)
    assert (here.appocc, here.packages, here.extras) == ("not installed", (), {})


def test_two_opencvs_in_one_folder(monkeypatch: pytest.MonkeyPatch) -> None:
    required = (Package("numpy", "2.0", None),)
    here = Environment(
        appocc="0.1",
        python="3.11",
        platform="Linux",
        cores=2,
        memory_bytes=None,
        free_memory_bytes=None,
        free_disk_bytes=1,
        gpu=None,
        packages=required,
        extras={},
    )
    monkeypatch.setattr(environment, "version_of", {"opencv-python": "4.10"}.get)
    assert here.complaints[0] == "numpy is not installed"
    assert here.complaints[1].startswith("opencv-python is installed as well as opencv-python-headless")
    monkeypatch.setattr(environment, "version_of", lambda name: None)
    assert len(here.complaints) == 1


def test_memory_as_linux_tells_it(tmp_path: Path) -> None:
    table = tmp_path / "meminfo"
    table.write_text("MemTotal:       1000 kB\nMemFree:  1 kB\nMemAvailable:    600 kB\n")
    assert memory(table) == (1_024_000, 614_400)
    table.write_text("MemTotal:       1000 kB\n")
    assert memory(table) == (None, None)
    assert memory(tmp_path / "none") == (None, None)


def test_a_gpu_is_asked_for_by_its_own_tool(monkeypatch: pytest.MonkeyPatch) -> None:
    answer = subprocess.CompletedProcess([], 0, "NVIDIA H200, 143771 MiB\nNVIDIA H200, 143771 MiB\n", "")
    monkeypatch.setattr(platform, "system", lambda: "Linux")
    monkeypatch.setattr(subprocess, "run", lambda *args, **kwargs: answer)
    assert gpu() == "NVIDIA H200, 143771 MiB"


@pytest.mark.parametrize(
    "failure",
    [FileNotFoundError("nvidia-smi"), subprocess.TimeoutExpired("x", 10), subprocess.CalledProcessError(9, "x")],
)
def test_no_gpu(monkeypatch: pytest.MonkeyPatch, failure: Exception) -> None:
    def fail(*args: Any, **kwargs: Any) -> Any:
        raise failure

    monkeypatch.setattr(platform, "system", lambda: "Linux")
    monkeypatch.setattr(subprocess, "run", fail)
    assert gpu() is None


def test_apple(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(platform, "system", lambda: "Darwin")
    monkeypatch.setattr(platform, "machine", lambda: "arm64")
    assert gpu() == "Apple GPU"


@pytest.fixture
def homeless(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A machine on which nothing but the temporary folder can be written."""
    for name in ("NUMBA_CACHE_DIR", "MPLCONFIGDIR"):
        monkeypatch.setenv(name, "")  # so that what is set here is put back
        monkeypatch.delenv(name)
    (tmp_path / "file").touch()
    (tmp_path / "temporary").mkdir()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file" / "cache"))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    return tmp_path


def test_caches_lie_in_a_private_folder_where_nothing_else_can_be_written(
    homeless: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    package, folder = homeless / "file" / "package", homeless / "temporary" / f"appocc-{os.getuid()}"
    environment.choose_cache_folders(package)
    assert os.environ["NUMBA_CACHE_DIR"] == str(folder / "numba")
    assert os.environ["MPLCONFIGDIR"] == str(folder / "matplotlib")
    assert folder.stat().st_mode & 0o777 == 0o700
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.startswith(f"compiled code is kept in {folder}: ")
    environment.choose_cache_folders(package)  # in a worker, say: all is well by now
    assert os.environ["NUMBA_CACHE_DIR"] == str(folder / "numba")
    assert capsys.readouterr().err == ""


def test_caches_that_can_be_written_stay_where_they_are(homeless: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    environment.choose_cache_folders(homeless)
    assert "NUMBA_CACHE_DIR" not in os.environ
    monkeypatch.setenv("XDG_CACHE_HOME", str(homeless / "new" / "cache"))
    monkeypatch.delenv("MPLCONFIGDIR")
    environment.choose_cache_folders(homeless / "file" / "package")
    assert "NUMBA_CACHE_DIR" not in os.environ
    assert "MPLCONFIGDIR" not in os.environ


@pytest.mark.parametrize("kind", ["open to others", "a link", "a file"])
def test_a_folder_that_others_may_have_filled_is_not_used(homeless: Path, kind: str) -> None:
    folder = homeless / "temporary" / f"appocc-{os.getuid()}"
    if kind == "a link":
        (homeless / "theirs").mkdir(mode=0o700)
        folder.symlink_to(homeless / "theirs")
    elif kind == "a file":
        folder.touch()
    else:
        folder.mkdir()
        folder.chmod(0o770)
    environment.choose_cache_folders(homeless / "file" / "package")
    assert "NUMBA_CACHE_DIR" not in os.environ
    assert "MPLCONFIGDIR" not in os.environ
