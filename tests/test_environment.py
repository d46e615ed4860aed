"""What the environment has and lacks, told from package metadata and the system's own words."""

from __future__ import annotations

import platform
import subprocess
from importlib import metadata
from pathlib import Path
from typing import Any

import pytest

from appocc import environment
from appocc.environment import Environment, Package, gpu, look_around, memory, version_of, wanted_packages


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
    required, extras = wanted_packages(lines)
    assert required == (Package("numpy", "2.0", "2.4"), Package("lark", "", None))
    assert extras == {"video": (Package("av", "14", None),), "dev": (Package("trackeval", "", None),)}


def test_versions_come_from_metadata() -> None:
    assert version_of("numpy") == metadata.version("numpy")
    assert version_of("no-such-package-anywhere") is None


def test_this_environment(tmp_path: Path) -> None:
    here = look_around(tmp_path)
    assert here.cores >= 1
    assert here.free_disk_bytes > 0
    assert {"torch", "numpy", "typer"} <= {package.name for package in here.packages}
    assert "dev" in here.extras


def test_the_suite_run_from_a_folder_that_is_not_installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def nothing(name: str) -> Any:
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(metadata, "requires", nothing)
    monkeypatch.setattr(metadata, "version", nothing)
    here = look_around(tmp_path)
    assert (here.appocc, here.packages, here.extras) == ("not installed", (), {})


def test_two_opencvs_in_one_folder(monkeypatch: pytest.MonkeyPatch) -> None:
    required = (Package("numpy", "2.0", None),)
    here = Environment("0.1", "3.11", "Linux", 2, None, None, 1, None, required, {})
    monkeypatch.setattr(environment, "version_of", {"opencv-python": "4.10"}.get)
    assert here.complaints[0] == "numpy is not installed"
    assert here.complaints[1].startswith("opencv-python is installed beside opencv-python-headless")
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
