"""What is half made is locked while it is made; what a killed process left of it is taken over."""

from __future__ import annotations

import errno
import fcntl
import os
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from appocc import files
from appocc.errors import DataError
from appocc.temporary import locked, made_folder, partial_file, partial_folder

# Dies in the middle of a file, a folder and a locked work.
KILLED = """
import os, signal, sys
from pathlib import Path
from appocc.files import whole_file
from appocc.temporary import locked, partial_folder
root = Path(sys.argv[1])
with whole_file(root / "a.bin") as file, partial_folder(root / "out") as folder, locked(root / ".lock", root):
    file.write_bytes(b"half")
    (folder / "half").mkdir()
    os.kill(os.getpid(), signal.SIGKILL)
"""


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_what_a_killed_process_left_is_taken_over(tmp_path: Path) -> None:
    assert subprocess.run([sys.executable, "-c", KILLED, str(tmp_path)], check=False).returncode == -9
    assert names(tmp_path) == [".a.partial.bin", ".lock", ".out.partial", ".out.partial.lock"]
    with partial_file(tmp_path / "a.bin") as file:
        assert file.stat().st_size == 0
    files.write_bytes(tmp_path / "a.bin", b"whole")
    with partial_folder(tmp_path / "out") as folder, locked(tmp_path / ".lock", tmp_path):
        assert names(folder) == []
    assert names(tmp_path) == ["a.bin"]


def test_what_another_process_is_at_is_left_alone(tmp_path: Path) -> None:
    with partial_folder(tmp_path / "out") as folder:
        (folder / "mine").touch()
        with pytest.raises(DataError, match=r"out: in use by another run$"):
            partial_folder(tmp_path / "out").__enter__()
        assert names(folder) == ["mine"]
    assert names(tmp_path) == []


def test_a_file_that_another_writes_is_waited_for(tmp_path: Path) -> None:
    """Both are written whole, one after the other."""
    path, begun = tmp_path / "a.bin", threading.Event()

    def other() -> None:
        begun.set()
        files.write_bytes(path, b"second")

    with files.whole_file(path) as temporary:
        thread = threading.Thread(target=other)
        thread.start()
        begun.wait()
        thread.join(0.1)
        assert thread.is_alive()
        temporary.write_bytes(b"first")
    thread.join()
    assert path.read_bytes() == b"second"
    assert names(tmp_path) == ["a.bin"]


def test_no_link_is_followed(tmp_path: Path) -> None:
    """A dataset from somewhere may hold one under the name that is written to."""
    (tmp_path / "precious").write_text("precious")
    (tmp_path / ".a.partial.bin").symlink_to(tmp_path / "precious")
    with pytest.raises(DataError, match=r"a\.bin: cannot be written"):
        files.write_bytes(tmp_path / "a.bin", b"x")
    assert (tmp_path / "precious").read_text() == "precious"


def test_a_disk_without_locks_can_be_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def none(handle: int, kind: int) -> None:
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr(fcntl, "flock", none)
    files.write_bytes(tmp_path / "a.bin", b"x")
    assert names(tmp_path) == ["a.bin"]


def test_folders_that_stay_empty_are_removed_again(tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    with made_folder(tmp_path / "mine" / "a" / "b"), made_folder(tmp_path / "mine" / "c"):
        (tmp_path / "mine" / "c" / "file").touch()
    assert names(tmp_path / "mine") == ["c"]
    with made_folder(tmp_path / "mine"):
        (tmp_path / "mine" / "c" / "file").unlink()
    assert names(tmp_path / "mine") == ["c"]
