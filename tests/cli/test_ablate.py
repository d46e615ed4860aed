from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from tiny_dataset import TinyDataset
from typer.testing import CliRunner, Result

from appocc.errors import AppoccError
from appocc.grid import BEVGrid
from appocc.training.checkpoint import list_checkpoints
from cli.main import app

TESTS = Path(__file__).parents[1]
TEXT = """
data: {train: tiny, val: tiny}
train: {steps: 4, batch: 4, lr: 0.02, ema: 0.5, threads: 1}
evaluate: {every_steps: 5, norm_batches: 3}
"""
# The command with the tiny network of the tests of the study.
TINY = f"""
import sys
sys.path[:0] = [{str(TESTS.parent)!r}, {str(TESTS)!r}, {str(TESTS / "ablation")!r}]
from made_study import made_predictor, tiny_train
from appocc.ablation import run
run.run_training, run.load_predictor = tiny_train, made_predictor
from cli.main import run
run()
"""


def run(*arguments: str) -> Result:
    return CliRunner().invoke(app, ["ablate", *arguments])


@pytest.fixture
def folder(tmp_path: Path, tiny: TinyDataset, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder with a configuration, and `tiny` with truth, for training and evaluating tiny networks."""
    monkeypatch.syspath_prepend(str(TESTS / "ablation"))
    from made_study import made_predictor, tiny_train, with_truth

    monkeypatch.setattr("appocc.ablation.run.run_training", tiny_train)
    monkeypatch.setattr("appocc.ablation.run.load_predictor", made_predictor)
    monkeypatch.setattr("appocc.training.loop.plot_curves", lambda lines, path: None)
    monkeypatch.chdir(tmp_path)
    with_truth(tiny)
    (tmp_path / "first.yaml").write_text(TEXT)
    return tmp_path


def test_a_repeated_study_keeps_its_results(folder: Path) -> None:
    words = ["first.yaml", "train.lr=0.01", "--test", "tiny", "--only", "^appocc-", "--seeds", "2", "--json"]
    result = run(*words)
    assert result.exit_code == 0, result.output
    value = json.loads(result.stdout)
    assert value == json.loads((folder / "runs/ablation/ablation.json").read_text())
    assert [row["name"] for row in value["rows"] if row["state"] == "done"] == [
        f"appocc-{setting}-{answers}-s{seed}"
        for seed in (0, 1)
        for setting in ("360", "180")
        for answers in ("occupancy", "both")
    ]
    assert value["training"]["train"]["lr"] == 0.01
    assert value["differences"]["180"][0]["seeds"] == [0, 1]
    assert result.stderr.strip().splitlines()[-1] == "runs/ablation/ablation.md: 8 of 26 rows done"
    again = run(*words)
    assert (again.exit_code, json.loads(again.stdout)) == (0, value)
    assert len(again.stderr.strip().splitlines()) == 1


def test_a_budget_of_zero_runs_nothing_and_succeeds(folder: Path) -> None:
    result = run("first.yaml", "--test", "tiny", "--budget-minutes", "0", "--out", "out", "--seeds", "1")
    assert (result.exit_code, result.stdout) == (0, "")
    assert result.stderr.strip() == "out/ablation.md: 0 of 18 rows done"


def test_a_row_without_training_is_evaluated_on_its_actual_output(folder: Path, tiny: TinyDataset) -> None:
    from made_study import with_truth

    with_truth(tiny, BEVGrid.surround())
    result = run("first.yaml", "--test", "tiny", "--only", "ipm", "--json", "--scenes", "1")
    assert result.exit_code == 0, result.output
    value = json.loads(result.stdout)
    for setting in ("360", "180"):
        (row,) = value["appearance"][setting]
        # Colours of the truth are random, so none is right; half of the cells are unseen.
        assert 60 < row["appearance_l1"]["mean"] < 110
        assert 0.1 < row["appearance_known"]["mean"] < 0.9
        assert value["iou"][setting] == []


def test_a_diverged_row_gives_exit_code_1_and_the_others_run(folder: Path) -> None:
    words = [
        "losses.classes=[1e300, 1, 1]",
        "train.warmup=0",
        "train.steps=20",
        "--test",
        "tiny",
        "--only",
        "appocc-180",
        "--seeds",
        "1",
    ]
    result = run("first.yaml", *words, "--out", "out")
    assert result.exit_code == 1
    assert result.stderr.strip().splitlines()[-1] == "out/ablation.md: 0 of 18 rows done, 2 diverged"
    assert "try a lower train.lr" in result.stderr


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["none.yaml"], "none.yaml: cannot be read"),
        (["first.yaml", "train.lr=high"], "train.lr: expected a number"),
        (["first.yaml", "data.train=nowhere"], "nowhere: no such folder"),
        (["first.yaml", "data.val=nowhere"], "nowhere: no such folder"),
        (["first.yaml", "--test", "nowhere"], "nowhere: no such folder"),
        (["first.yaml", "init=some.safetensors"], "expected init null, got 'some.safetensors'"),
        (["first.yaml", "data.source=groundtruth"], "3 of 3 samples have no BEV map"),
        (["first.yaml", "--only", "lsss"], "'lsss': expected part of a row's name"),
        (["first.yaml", "--only", "["], "expected a regular expression"),
        (["first.yaml", "--version", "v9"], "v9"),
        (["first.yaml", "--out", "first.yaml"], "first.yaml"),
    ],
)
def test_bad_input_is_reported_and_writes_nothing(folder: Path, arguments: list[str], said: str) -> None:
    before = sorted(folder.rglob("*"))
    result = run("--test", "tiny", *arguments)
    assert isinstance(result.exception, AppoccError)
    assert result.exception.exit_code == 2
    assert said in str(result.exception)
    assert "\n" not in str(result.exception)
    assert result.stdout == ""
    assert sorted(folder.rglob("*")) == before


def test_a_different_study_in_the_same_folder_is_rejected(folder: Path) -> None:
    words = ["--test", "tiny", "--only", "appocc-360-both-s0"]
    assert run("first.yaml", *words).exit_code == 0
    result = run("first.yaml", "train.steps=5", *words)
    assert "other values of train.steps" in str(result.exception)


@pytest.mark.parametrize("sent", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.slow)])
def test_an_interruption_says_how_to_resume(folder: Path, sent: signal.Signals) -> None:
    words = ["ablate", "first.yaml", "train.steps=4000", "evaluate.every_steps=100000", "save.every_steps=20"]
    command = [sys.executable, "-c", TINY, *words, "--test", "tiny", "--out", "out"]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    deadline = time.monotonic() + 300
    while not list(folder.glob("out/*/state-*")):
        assert process.poll() is None, process.communicate()[1]
        assert time.monotonic() < deadline
        time.sleep(0.02)
    process.send_signal(sent)
    said = process.communicate(timeout=120)[1]
    assert process.returncode == 128 + sent
    assert said.strip() == "stopped; the same command resumes"
    assert list_checkpoints(folder / "out" / "appocc-360-occupancy-s0")
    assert '"begun"' in (folder / "out" / "ablation.json").read_text()


@pytest.mark.slow
@pytest.mark.long
def test_real_networks_from_images_to_tables(
    tmp_path: Path, simulated_root: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    text = {
        "data": {"train": str(simulated_root), "val": str(simulated_root), "packs": "packs"},
        "train": {"steps": 1, "batch": 1, "threads": 1, "device": "cpu"},
        "evaluate": {"samples": 1, "norm_batches": 1},
    }
    (tmp_path / "one.yaml").write_text(json.dumps(text))  # JSON is YAML
    words = ["--test", str(simulated_root), "--scenes", "1", "--seeds", "1", "--out", "out", "--json"]
    result = run("one.yaml", *words, "--only", "180")
    assert result.exit_code == 0, result.output
    value = json.loads(result.stdout)
    assert [row["state"] for row in value["rows"] if row["setting"] == "180"] == ["done"] * 7
    assert {row["network"] for row in value["iou"]["180"]} == {"appocc", "lss", "paper", "neat"}
    assert {row["network"] for row in value["appearance"]["180"]} == {"appocc", "ipm", "paper"}
    assert {row["network"] for row in value["differences"]["180"]} == {"appocc", "paper"}
    for row in value["iou"]["180"]:
        assert 0 <= row["iou_at_threshold"]["road"]["mean"] <= 1
