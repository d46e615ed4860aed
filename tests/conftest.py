"""Shared fixtures: the recorded data beside the repository, where it is present, and a tiny dataset made by hand."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings
from tiny_dataset import TinyDataset

# The same examples on every run, and no limit of time: the machine may be busy.
settings.register_profile("steady", derandomize=True, deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("steady")


@pytest.fixture(scope="session")
def data_root() -> Path:
    """Folder of the recorded data (`$APPOCC_DATA`, or ../shared/data beside the repository); skips where absent."""
    named = os.environ.get("APPOCC_DATA")
    root = Path(named) if named else Path(__file__).parents[2] / "shared" / "data"
    if not root.is_dir():
        pytest.skip(f"no recorded data at {root}; set APPOCC_DATA to its folder")
    return root


@pytest.fixture
def tiny(tmp_path: Path) -> TinyDataset:
    """A dataset of one scene in a folder of its own; change `tables`, then `write`."""
    return TinyDataset(tmp_path / "tiny")


@pytest.fixture
def tiny_root(tiny: TinyDataset) -> Path:
    """The root of that dataset."""
    return tiny.root


@pytest.fixture(scope="session")
def panda_root(data_root: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The recorded street (PandaSet 002) converted to the nuScenes schema once for all tests; read only."""
    from appocc.pandaset import convert_folder

    out = tmp_path_factory.mktemp("panda") / "panda"
    convert_folder(data_root / "pandaset_002", out, data_root / "pandaset_002_lidar", False, lambda _: None)
    return out


@pytest.fixture(scope="session")
def panda_bev(panda_root: Path) -> Path:
    """That dataset with its ground-truth maps below bev/groundtruth; read only."""
    from appocc.grid import BEVGrid
    from appocc.groundtruth.compose import Settings
    from appocc.groundtruth.pipeline import generate
    from appocc.nuscenes import Dataset

    dataset = Dataset(panda_root)
    generate(dataset, dataset.scenes, panda_root, Settings(BEVGrid.surround(), "robust"), 2, lambda _: None)
    return panda_root
