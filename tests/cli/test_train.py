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
from appocc.temporary import locked
from appocc.training.checkpoint import list_checkpoints
from cli.main import app

REPOSITORY = Path(__file__).parents[2]
TEXT = """
data: {train: none, val: none}
train: {steps: 12, batch: 4, lr: 0.02, ema: 0.5, threads: 1}
evaluate: {every_steps: 5, norm_batches: 3}
"""
# The command with the tiny network and samples of the tests of the training loop.
TINY = f"""
import sys
sys.path[:0] = [{str(REPOSITORY)!r}, {str(REPOSITORY / "tests" / "training")!r}]
from appocc.training import session
from made_training import made_setup
session.prepare_training = lambda config, processes, monitor: made_setup(config, processes)
from cli.main import run
run()
"""


def run(*arguments: str) -> Result:
    return CliRunner().invoke(app, ["train", *arguments])


@pytest.fixture
def tiny_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(REPOSITORY / "tests" / "training"))
    from made_training import made_setup

    monkeypatch.setattr(
        "appocc.training.session.prepare_training", lambda config, processes, monitor: made_setup(config, processes)
    )


@pytest.fixture
def config(tmp_path: Path) -> Path:
    path = tmp_path / "first.yaml"
    path.write_text(TEXT)
    return path


def test_a_run_and_its_repetition(
    tmp_path: Path, config: Path, tiny_parts: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    result = run(str(config), "train.lr=0.01", "--json")
    assert result.exit_code == 0, result.output
    value = json.loads(result.stdout)
    assert (value["folder"], value["steps"]) == ("runs/first", 12)
    assert set(value["best"]["best_iou"]) == {"road", "vehicle", "lane"}
    assert "best.safetensors: step" in result.stderr
    assert "lr: 0.01" in (tmp_path / "runs" / "first" / "config.yaml").read_text()
    again = run(str(config), "train.lr=0.01", "--resume", "--json")
    assert json.loads(again.stdout) == value
    other = run(str(config), "--resume")
    assert other.exception is not None
    assert "other values of train.lr" in str(other.exception)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["none.yaml"], "none.yaml: cannot be read"),
        (["first.yaml", "train.lr=high"], "train.lr: expected a number"),
        (["first.yaml", "--resume"], "no run to resume"),
        (["first.yaml", "--out", "first.yaml"], "expected a new or empty folder, got a file"),
        (["first.yaml", "--out", "."], "expected a new or empty folder, got one with first.yaml"),
        (["first.yaml", "network=resnet"], "no network 'resnet'"),
        (["first.yaml", "data.train=nowhere"], "data.train: nowhere: no such folder; name a dataset"),
        (
            ["first.yaml", "data.train=tiny", "data.val=nowhere"],
            "or none: data.val=null data.held_out=1",
        ),
        (["first.yaml", "data.train=tiny", "data.val=tiny", "data.source=exact"], "no BEV map"),
        (["first.yaml", "train.batch=60000"], "train.batch=60000: expected at most 10,591 samples (181 GiB"),
        (["first.yaml", "train.device=cuda"], "torch finds no GPU"),
    ],
)
def test_bad_input_is_reported_and_writes_nothing(
    tmp_path: Path, config: Path, tiny: TinyDataset, monkeypatch: pytest.MonkeyPatch, arguments: list[str], said: str
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("torch.cuda.is_available", lambda: False)
    monkeypatch.setattr("appocc.training.session.memory", lambda: (32 * 2**30, None))
    before = sorted(tmp_path.rglob("*"))
    result = run(*arguments)
    assert isinstance(result.exception, AppoccError)
    assert result.exception.exit_code == 2
    assert said in str(result.exception)
    assert "\n" not in str(result.exception)
    assert result.stdout == ""
    assert sorted(tmp_path.rglob("*")) == before


def test_an_empty_folder_is_accepted_and_locked_by_its_run(tmp_path: Path, config: Path, tiny_parts: None) -> None:
    out = tmp_path / "run"
    out.mkdir()
    with locked(out / ".lock", out):
        for resume in ([], ["--resume"]):
            refused = run(str(config), "--out", str(out), *resume)
            assert isinstance(refused.exception, AppoccError)
            assert str(refused.exception) == f"{out}: in use by another run"
            (out / "config.yaml").write_text(TEXT)
        (out / "config.yaml").unlink()
    assert run(str(config), "--out", str(out)).exit_code == 0
    assert not (out / ".lock").exists()
    assert run(str(config), "--out", str(out), "--resume").exit_code == 0


def test_divergence_gives_exit_code_1(tmp_path: Path, config: Path) -> None:
    poisoned = TINY.replace("processes)\n", "processes, poison=Poison(7, float('nan')))\n")
    poisoned = poisoned.replace("import made_setup", "import Poison, made_setup")
    command = [sys.executable, "-c", poisoned, "train", str(config), "--out", "run"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=tmp_path)
    assert done.returncode == 1
    last = done.stderr.strip().splitlines()[-1]
    assert last.startswith("error: step 8: expected finite losses")
    assert "try a lower train.lr" in last
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    ("sent", "code"),
    [
        (signal.SIGINT, 130),
        pytest.param(signal.SIGTERM, 143, marks=pytest.mark.slow),
        pytest.param(signal.SIGKILL, -9, marks=pytest.mark.slow),
    ],
    ids=["ctrl-c", "terminated", "killed"],
)
def test_a_run_interrupted_anywhere_resumes(tmp_path: Path, config: Path, sent: signal.Signals, code: int) -> None:
    words = ["train", str(config), "train.steps=4000", "evaluate.every_steps=100000", "save.every_steps=20"]
    command = [sys.executable, "-c", TINY, *words, "--out", str(tmp_path / "run")]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    deadline = time.monotonic() + 300
    while not list(tmp_path.glob("run/state-*")):
        assert process.poll() is None, process.communicate()[1]
        assert time.monotonic() < deadline
        time.sleep(0.02)
    process.send_signal(sent)
    said = process.communicate(timeout=120)[1]
    assert process.returncode == code
    if sent != signal.SIGKILL:
        assert len(said.strip().splitlines()) == 1
        assert "use --resume to continue" in said
    reached = list_checkpoints(tmp_path / "run")[0].name
    assert 20 <= int(reached[6:14]) < 4000
