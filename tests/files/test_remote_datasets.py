"""Datasets and results in a bucket: the same bytes as on a disk."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from in_process import run_command
from made_model import predictor, save_road_everywhere
from s3_server import S3Server
from tiny_dataset import TinyDataset, token

from appocc import Dataset, load_map
from appocc.files import path_of, write_image
from appocc.inference.inputs import dataset_inputs
from appocc.inference.run import InferenceRun, InferenceSummary
from appocc.visualization.predictions import prediction_figure
from appocc.visualization.vehicle_marks import VehicleMarks

NO_VEHICLES = VehicleMarks(np.empty((0, 2)), np.empty(0), np.empty((0, 2)), np.empty(0, np.bool_), np.empty((0, 3)))


def infer(root: str | Path, out: str | Path, most: int = 99) -> InferenceSummary:
    """Predict the maps of a dataset, `most` of them."""
    dataset = Dataset(root)
    run = InferenceRun(dataset_inputs(dataset, dataset.scenes), predictor(), out)
    for result in run:
        if result is not None:
            assert result.picture is not None
            write_image(result.picture, prediction_figure(result.frame, result.bev, NO_VEHICLES))
            most -= 1
        if most < 0:
            break
    return run.summary


def files_of(folder: Path) -> dict[str, bytes]:
    """The files below a folder by name."""
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_maps_of_a_bucket_written_to_a_bucket_are_the_same_bytes(s3: S3Server, tiny: TinyDataset) -> None:
    root = s3.put(tiny.root, "data")
    assert infer(root, f"{root}/bev/mine")[:2] == (3, 0)
    assert infer(tiny.root, tiny.root / "bev" / "mine")[:2] == (3, 0)
    local, remote = files_of(tiny.root / "bev"), s3.contents("data", "bev/")
    assert len(local) == 7
    assert {f"bev/{name}": data for name, data in local.items() if "jsonl" not in name} == {
        name: data for name, data in remote.items() if "jsonl" not in name
    }
    assert load_map(root, "mine", token("sample", 0)).meta["token"] == token("sample", 0)
    assert path_of(f"{root}/bev/mine").is_dir()


def test_commands_read_a_bucket(
    s3: S3Server, tiny: TinyDataset, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    save_road_everywhere(tiny)
    root = s3.put(tiny.root, "data")
    answers = []
    for place in (str(tiny.root), root):
        doctor = run_command(["doctor", place, "--json"], capsys, monkeypatch)
        scores = run_command(["eval", "bev", place, "--bev", "exact", "--json"], capsys, monkeypatch)
        assert (doctor.returncode, scores.returncode) == (0, 0), doctor.stderr + scores.stderr
        answers.append([json.loads(doctor.stdout)["dataset"] | {"root": ""}, json.loads(scores.stdout)])
    assert answers[0] == answers[1]
