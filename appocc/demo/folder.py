"""The demo's folder: made apart, put in its place when all is there; what others put there stays."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from appocc.errors import DataError
from appocc.files import inside, read_json, write_json

MANIFEST = "demo.json"
_MADE_BY = "appocc demo"


@contextmanager
def demo_folder(out: Path) -> Iterator[Path]:
    """An empty folder to fill; when the block ends well its files are moved to `out`, else `out` stays as it was.

    `out` is new, empty, or an earlier demo. Of an earlier demo the files that it made are replaced; all others stay.

    Raises:
        DataError: if `out` is something else, or cannot be written.
    """
    before = _made_before(out)
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        temporary = tempfile.TemporaryDirectory(prefix=f".{out.name}-", dir=out.parent)
    except OSError as error:
        raise DataError(f"{out}: cannot be written ({error.strerror})") from error
    with temporary as name:
        folder = Path(name)
        yield folder
        made = sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())
        write_json(folder / MANIFEST, {"made_by": _MADE_BY, "files": made})
        try:
            _put(folder, out, before, made)
        except OSError as error:
            raise DataError(f"{out}: cannot be written ({error.strerror})") from error


def _made_before(out: Path) -> list[str]:
    """The files of an earlier demo, below `out`."""
    if not out.exists() or (out.is_dir() and not any(out.iterdir())):
        return []
    if not (out / MANIFEST).is_file():
        raise DataError(
            f"{out}: exists and is no demo of ours (it has no {MANIFEST}); name another folder with --out"
        )
    manifest = read_json(out / MANIFEST)
    if not isinstance(manifest, dict) or manifest.get("made_by") != _MADE_BY:
        raise DataError(f"{out / MANIFEST}: not written by '{_MADE_BY}'; name another folder with --out")
    files = manifest.get("files")
    if not isinstance(files, list) or not all(isinstance(name, str) for name in files):
        raise DataError(f"{out / MANIFEST}: expected 'files', a list of names; name another folder with --out")
    for name in files:
        inside(out, name)
    return files


def _put(folder: Path, out: Path, before: list[str], made: list[str]) -> None:
    """Move the new files to `out`, the list of them last, and remove those of before that are not made any more."""
    for name in [*made, MANIFEST]:
        target = out / name
        target.parent.mkdir(parents=True, exist_ok=True)
        (folder / name).replace(target)
    for name in set(before) - set(made):
        (out / name).unlink(missing_ok=True)
