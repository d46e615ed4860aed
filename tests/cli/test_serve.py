"""`appocc serve` as a command: errors in one line, the token, Ctrl-C."""

from __future__ import annotations

import json
import re
import signal
import socket
import subprocess
import sys
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from in_process import run_command
from made_recording import write_recording
from walkthrough import blocks

from appocc.errors import DataError
from cli.server.running import address_of, bound_socket

_PATIENCE_S = 120


@contextmanager
def serving(*arguments: str) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """Run the command until it has printed its address."""
    command = [sys.executable, "-m", "appocc", "serve", "--port", "0", *arguments]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, cwd=Path(__file__).parents[2]) as process:
        try:
            assert process.stderr is not None
            line = process.stderr.readline()
            found = re.search(r"Open (http\S+)", line)
            assert found, line
            process.stderr.readline()
            yield process, found[1]
        finally:
            process.kill()


def status(address: str) -> int:
    try:
        with urllib.request.urlopen(address, timeout=_PATIENCE_S) as answer:
            return int(answer.status)
    except urllib.error.HTTPError as error:
        error.close()
        return error.code


def test_it_serves_until_ctrl_c(tmp_path: Path) -> None:
    root = write_recording(tmp_path / "made", 1)
    with serving(str(root)) as (process, address):
        assert address.startswith("http://127.0.0.1:")
        assert status(address) == 200
        process.send_signal(signal.SIGINT)
        assert process.wait(_PATIENCE_S) == 0
        assert process.stderr is not None
        assert process.stderr.read() == "closed\n"


def test_the_line_of_the_readme_opens_the_folder_of_the_demo(tmp_path: Path) -> None:
    write_recording(tmp_path / "appocc-demo" / "dataset", 1)
    (line,) = blocks("## In the browser")[0].splitlines()
    assert line.split()[:2] == ["appocc", "serve"]
    with serving(*(str(tmp_path / name) for name in line.split()[2:])) as (_, address):
        with urllib.request.urlopen(f"{address}api/recordings", timeout=_PATIENCE_S) as answer:
            listed = json.load(answer)
        assert [one["title"] for one in listed["recordings"]] == ["appocc-demo/dataset"]
        assert listed["drives"] is not None


def test_bound_elsewhere_it_needs_the_token(tmp_path: Path) -> None:
    root = write_recording(tmp_path / "made", 1)
    with serving(str(root), "--host", "0.0.0.0") as (_, address):
        plain, _, token = address.partition("?token=")
        here = plain.replace("0.0.0.0", "127.0.0.1")
        assert len(token) >= 24
        assert status(here) == 401
        opener = urllib.request.build_opener(urllib.request.HTTPCookieProcessor())
        with opener.open(f"{here}?token={token}", timeout=_PATIENCE_S) as answer:
            assert answer.status == 200


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["missing"], "missing: expected a dataset or a folder of datasets, got no such folder"),
        (["full/thesis.tex"], "thesis.tex: expected a dataset or a folder of datasets, got a file"),
        (["full"], "full: no nuScenes-schema dataset in it"),
        (["damaged"], "v1.0-made"),
        (["empty", "--host", "no.such.host.invalid"], "no such address"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(
    arguments: list[str],
    reason: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for name in ("empty", "full", "damaged/v1.0-made"):
        (tmp_path / name).mkdir(parents=True)
    (tmp_path / "full" / "thesis.tex").write_text("")
    (tmp_path / "damaged" / "v1.0-made" / "sample_data.json").write_text("[")
    monkeypatch.chdir(tmp_path)
    done = run_command(["serve", *arguments], capsys, monkeypatch)
    assert done.returncode == 2, done.stderr
    assert done.stderr.startswith("error: ")
    assert reason in done.stderr
    assert done.stderr.count("\n") == 1


def test_a_port_in_use_is_named() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(DataError, match=f"127.0.0.1:{port}: expected a free port .*--port"):
            bound_socket("127.0.0.1", port)


def test_the_address_is_one_for_a_browser() -> None:
    with bound_socket("localhost", 0) as bound:
        assert address_of("localhost", bound) == f"http://localhost:{bound.getsockname()[1]}/"
        assert address_of("::1", bound).startswith("http://[::1]:")
