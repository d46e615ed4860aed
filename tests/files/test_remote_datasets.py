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
from appocc.doctor import contents_of
from appocc.files import write_image
from appocc.inference.inputs import dataset_inputs
from appocc.inference.run import InferenceRun, InferenceSummary
from appocc.nuscenes.view_targets import ViewTargets, save_view_targets, view_targets_path
from appocc.visualization.predictions import prediction_figure
from appocc.visualization.vehicle_marks import VehicleMarks

NO_VEHICLES = VehicleMarks(np.empty((0, 2)), np.empty(0), np.empty((0, 2)), np.empty(0, np.bool_), np.empty((0, 3)))


def infer(root: str | Path, out: str | Path, most: int = 99) -> InferenceSummary:
    """Predict the maps of a dataset; the run is given up after `most` of them."""
    dataset = Dataset(root)
    run = InferenceRun(dataset_inputs(dataset, dataset.scenes), predictor(), out)
    for result in run:
        if most == 0:
            break
        most -= 1
        if result is not None:
            assert result.picture is not None
            write_image(result.picture, prediction_figure(result.frame, result.bev, NO_VEHICLES))
    return run.summary


def files_of(folder: Path) -> dict[str, bytes]:
    """The files below a folder by name, without the record of their inputs, which has times of files."""
    paths = [path for path in folder.rglob("*") if path.is_file() and path.suffix != ".jsonl"]
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in paths}


def objects_of(s3: S3Server, bucket: str, folder: str) -> dict[str, bytes]:
    """The same for a folder in a bucket."""
    found = s3.contents(bucket, f"{folder}/")
    return {key.removeprefix(f"{folder}/"): data for key, data in found.items() if not key.endswith(".jsonl")}


def test_maps_of_a_bucket_written_to_a_bucket_are_the_same_bytes(s3: S3Server, tiny: TinyDataset) -> None:
    root = s3.put(tiny.root, "data")
    infer(tiny.root, tiny.root / "bev" / "mine")
    out = f"{root}/bev/mine"
    assert infer(root, out, most=1)[:2] == (1, 0)  # interrupted
    assert [key for key in s3.contents("data", "bev/") if "jsonl" in key] == [
        f"bev/mine/.inputs.jsonl/{token('sample', 0)}"
    ]
    assert infer(root, out)[:2] == (2, 1)
    assert infer(root, out)[:2] == (0, 3)
    assert objects_of(s3, "data", "bev/mine") == files_of(tiny.root / "bev" / "mine")
    assert s3.contents("data", "bev/mine/inputs.jsonl")["bev/mine/inputs.jsonl"].count(b"\n") == 3
    assert load_map(root, "mine", token("sample", 0)).meta["token"] == token("sample", 0)
    changed = next(row for row in tiny.tables["sample_data"] if row["filename"].endswith(".jpg"))["filename"]
    write_image(f"{root}/{changed}", np.full((20, 32, 3), 90, np.uint8))
    summary = infer(root, out)
    assert (summary.made, summary.kept, summary.stale) == (1, 2, {"pictures changed": 1})


COMMANDS = (
    "doctor ROOT --json",
    "track scene ROOT --bev exact --json",
    "report ROOT --bev exact --out OUT/report.html --json",
    "groundtruth ROOT --workers 1 --json",
)


@pytest.mark.parametrize("command", COMMANDS)
def test_commands_answer_for_a_bucket_as_for_a_folder(
    command: str,
    s3: S3Server,
    tiny: TinyDataset,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    save_road_everywhere(tiny)
    before = set(files_of(tiny.root))
    root = s3.put(tiny.root, "data")
    answers = []
    for place in (str(tiny.root), root):
        words = command.replace("ROOT", place).replace("OUT", f"{place}/out").split()
        done = run_command(words, capsys, monkeypatch)
        assert done.returncode == 0, done.stderr
        answers.append(json.loads(done.stdout.replace(place, "ROOT")))
        for name in ("seconds", "environment", "bytes"):  # a page names its dataset
            answers[-1].pop(name, None)
    assert answers[0] == answers[1]
    local, remote = files_of(tiny.root), s3.contents("data")
    made = sorted(set(local) - before)
    assert sorted(key for key in set(remote) - before if not key.endswith(".jsonl")) == made
    assert {name: remote[name] for name in made if "report" not in name} == {
        name: local[name] for name in made if "report" not in name
    }


def test_pixel_classes_are_counted_on_a_disk_and_not_in_a_bucket(s3: S3Server, tiny: TinyDataset) -> None:
    view = ViewTargets(None, np.zeros((3, 4), np.uint8))
    path = view_targets_path(tiny.root, token("sample", 0))
    save_view_targets(path, {"CAM_FRONT": view, "CAM_BACK": view})
    view_targets_path(tiny.root, token("sample", 1)).write_bytes(b"damaged")
    assert contents_of(Dataset(tiny.root)).pixel_classes == 2
    assert contents_of(Dataset(s3.put(tiny.root, "data"))).pixel_classes is None
