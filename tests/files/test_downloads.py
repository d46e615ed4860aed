"""Downloads of tables from a bucket have a progress bar; small ones and those of other threads have none."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Thread

import pytest
from s3_server import S3Server

from appocc.files import local_copy, path_of
from appocc.files.downloads import show_downloads

SIZE = 1_500_000


@pytest.fixture
def bars() -> Iterator[dict[str, list[float]]]:
    """The steps of each bar by its title, the total first."""
    seen: dict[str, list[float]] = {}

    @contextmanager
    def bar(title: str, total: float) -> Iterator[Callable[[float], None]]:
        seen[title] = [total]
        yield seen[title].append

    show_downloads(bar)
    yield seen
    show_downloads(None)


def test_large_downloads_are_counted_in_megabytes(s3: S3Server, tmp_path: Path, bars: dict[str, list[float]]) -> None:
    (tmp_path / "data").mkdir()
    for name, size in (("sample_data.json", SIZE), ("log.json", 999), ("thread.json", SIZE)):
        (tmp_path / "data" / name).write_bytes(b"1" * size)
    root = path_of(s3.put(tmp_path / "data", "data"))
    assert local_copy(root / "sample_data.json").stat().st_size == SIZE
    assert local_copy(root / "log.json").stat().st_size == 999
    thread = Thread(target=local_copy, args=(root / "thread.json",))
    thread.start()
    thread.join()
    ((title, (total, *steps)),) = bars.items()
    assert (title, total) == ("fetching sample_data.json, MB", 1.5)
    assert sum(steps) == pytest.approx(total)
    assert local_copy(root / "sample_data.json").stat().st_size == SIZE  # the copy: no second bar
    assert len(bars[title]) == 1 + len(steps)
