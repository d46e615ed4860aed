"""Folder of the demo: written to a temporary folder and moved when complete; files of the user are kept."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from appocc.errors import DataError
from appocc.files import inside, read_json, write_json
from appocc.temporary import made_folder, partial_folder

MANIFEST = "demo.json"
_MADE_BY = "appocc demo"
_UNFINISHED = ".unfinished-demo-"


@contextmanager
def demo_folder(out: Path) -> Iterator[Path]:
    """Yield an empty folder; on success move its files to `out`, otherwise leave `out` unchanged.

    `out` is new, empty, or an earlier demo, whose own files are replaced; all other files are kept.

    Raises:
        DataError: if `out` is something else, or cannot be written.
    """
    before = _made_before(out)
    try:
        # On the same disk as `out`, which may be a mount point.
        place = out / "demo" if out.is_dir() else out
        with made_folder(place.parent), partial_folder(place, f"{_UNFINISHED}{out.name}") as folder:
            yield folder
            _put(folder, out, before)
    except OSError as error:
        raise DataError(f"{out}: cannot be written ({error.strerror or error})") from error


def _made_before(out: Path) -> list[str]:
    """Return the files of an earlier demo below `out`."""
    if not out.exists():
        return []
    if not (out / MANIFEST).is_file():
        if out.is_dir() and all(path.name.startswith(_UNFINISHED) for path in out.iterdir()):
            return []
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


def _put(folder: Path, out: Path, before: list[str]) -> None:
    """Move the new files to `out` and remove files of the earlier demo that have no successor.

    Meanwhile the manifest lists both, so that a later run recognises them after an interruption.
    """
    made = [str(path.relative_to(folder)) for path in sorted(folder.rglob("*")) if path.is_file()]
    _list(out, {*before, *made})
    for name in made:
        target = out / name
        target.parent.mkdir(parents=True, exist_ok=True)
        (folder / name).replace(target)
    for name in set(before) - set(made):
        (out / name).unlink(missing_ok=True)
    _list(out, made)


def _list(out: Path, files: Iterable[str]) -> None:
    write_json(out / MANIFEST, {"made_by": _MADE_BY, "files": sorted(files)})
