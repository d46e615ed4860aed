"""Two launches of torchrun on loopback stand for two nodes; a process of one is killed and the training goes on."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from made_training import made_config

from appocc.errors import DataError
from appocc.training.process_group import join_process_group
from appocc.training.run_folder import RunFolder

TIMES = ("seconds", "wait_share", "plan_share", "samples_per_s", "evaluation_s")
# Rank 1 kills itself after step 7, once: the checkpoint is that of step 4.
NODE = """
import os, signal, sys
from pathlib import Path
sys.path[:0] = {path!r}
from made_training import made_config, run
from appocc.training.run import TrainingMonitor
from appocc.training.run_folder import RunFolder
folder, killed = Path({folder!r}), Path({killed!r})
monitor = TrainingMonitor()
def on_step(share, text):
    if {kill} and os.environ["RANK"] == "1" and text.startswith("step 7,") and not killed.exists():
        killed.touch()
        os.kill(os.getpid(), signal.SIGKILL)
monitor.on_step = on_step
run(folder, made_config(), monitor, resume=RunFolder(folder).is_of_this_launch())
"""


def train_on_two_nodes(folder: Path, kill: bool) -> list[str]:
    """Train with a process on each of two nodes; return what they print."""
    script = folder.with_suffix(".py")
    paths = [str(Path(__file__).parent), str(Path(__file__).parents[2])]
    script.write_text(
        NODE.format(path=paths, folder=str(folder), killed=str(folder.with_suffix(".killed")), kill=kill)
    )
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    command = [sys.executable, "-m", "torch.distributed.run", "--nnodes", "2", "--nproc-per-node", "1"]
    command += ["--rdzv-backend", "c10d", "--rdzv-endpoint", f"127.0.0.1:{port}", "--rdzv-id", "made"]
    command += ["--max-restarts", "2", "--monitor-interval", "0.2"]
    environment = os.environ | {"OMP_NUM_THREADS": "1", "GLOO_SOCKET_IFNAME": "lo"}
    environment["TORCH_DISABLE_SHARE_RDZV_TCP_STORE"] = "1"
    nodes = [
        subprocess.Popen(
            [*command, "--local-addr", f"127.0.0.{node + 1}", "--rdzv-conf", f"is_host={1 - node}", str(script)],
            env=environment,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        for node in range(2)
    ]
    try:
        said = [node.communicate(timeout=240)[1] for node in nodes]
    finally:
        for node in nodes:
            if node.poll() is None:
                os.killpg(node.pid, signal.SIGKILL)
    assert [node.returncode for node in nodes] == [0, 0], "\n".join(said)
    return said


def numbers(folder: Path) -> list[dict[str, Any]]:
    """Lines of metrics without what a clock says."""
    return [{k: v for k, v in line.items() if k not in TIMES} for line in RunFolder(folder).read_metrics()]


@pytest.mark.slow
def test_a_process_of_two_nodes_is_killed_and_the_training_resumes_with_the_same_numbers(tmp_path: Path) -> None:
    train_on_two_nodes(tmp_path / "whole", kill=False)
    said = train_on_two_nodes(tmp_path / "run", kill=True)
    assert "lost another process of the training; --resume continues it" in said[0]
    assert (tmp_path / "run.killed").exists()
    assert numbers(tmp_path / "run") == numbers(tmp_path / "whole")
    assert numbers(tmp_path / "run")[-1]["step"] == 12
    assert (tmp_path / "run/best.safetensors").read_bytes() == (tmp_path / "whole/best.safetensors").read_bytes()


def test_restarts_that_would_wait_forever_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    names = {"WORLD_SIZE": "2", "TORCHELASTIC_MAX_RESTARTS": "3", "TORCHELASTIC_USE_AGENT_STORE": "True"}
    for name, value in names.items():
        monkeypatch.setenv(name, value)
    with pytest.raises(DataError, match="expected TORCH_DISABLE_SHARE_RDZV_TCP_STORE=1"), join_process_group("cpu"):
        pass


def test_only_the_run_of_the_same_launch_resumes_by_itself(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = RunFolder(tmp_path / "run")
    monkeypatch.setenv("TORCHELASTIC_RUN_ID", "job-7")
    assert not folder.is_of_this_launch()  # there is none
    folder.create(made_config())
    assert folder.is_of_this_launch()
    monkeypatch.setenv("TORCHELASTIC_RUN_ID", "job-8")
    assert not folder.is_of_this_launch()
    for absent in ("none", None):  # torchrun's default, and no torchrun
        monkeypatch.setenv("TORCHELASTIC_RUN_ID", absent) if absent else monkeypatch.delenv("TORCHELASTIC_RUN_ID")
        (tmp_path / "run" / "config.yaml").unlink()
        folder.create(made_config())
        assert not folder.is_of_this_launch()


def test_the_slurm_script_starts_torchrun_on_each_node(tmp_path: Path) -> None:
    programs = {
        "scontrol": 'echo "node-a\nnode-b"',
        "srun": 'printf "%s\\n" "$TORCH_DISABLE_SHARE_RDZV_TCP_STORE" "$@"',
    }
    for name, line in programs.items():
        (tmp_path / name).write_text(f"#!/bin/sh\n{line}\n")
        (tmp_path / name).chmod(0o755)
    job = {"SLURM_JOB_NODELIST": "node-[a-b]", "SLURM_NNODES": "2", "SLURM_JOB_ID": "7", "SLURM_GPUS_ON_NODE": "8"}
    command = [
        "bash",
        str(Path(__file__).parents[2] / "configs" / "train.slurm"),
        "small",
        str(tmp_path),
        "train.lr=1e-3",
    ]
    environment = {**job, "PATH": f"{tmp_path}:{os.environ['PATH']}"}
    first = subprocess.check_output(command, env=environment, text=True).split()
    RunFolder(tmp_path).create(made_config())
    again = subprocess.check_output(command, env=environment, text=True).split()
    assert first[:2] == ["1", "torchrun"]
    for option in (
        "--nnodes 2",
        "--nproc-per-node 8",
        "--rdzv-endpoint node-a:29400",
        "--rdzv-id 7",
        "--max-restarts 3",
    ):
        assert option in " ".join(first)
    assert first[-7:] == ["-m", "appocc", "train", "small", "train.lr=1e-3", "--out", str(tmp_path)]
    assert again == [*first, "--resume"]
