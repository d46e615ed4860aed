"""Paths that are URLs behave as paths do."""

from __future__ import annotations

import pickle
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from s3_server import S3Server

from appocc import files
from appocc.errors import DataError
from appocc.files import RemotePath, path_of

NAMES = st.text(st.characters(exclude_characters="/\0", exclude_categories=["Cs"]), min_size=1, max_size=9)


@pytest.mark.parametrize("url", ["s3://b/a/c.tar.gz", "gs://b/a/c.tar.gz", "https://h.org:8080/a/c.tar.gz"])
def test_names_are_joined_and_taken_apart(url: str) -> None:
    path = path_of(url)
    assert isinstance(path, RemotePath)
    assert str(path) == f"{path}" == url
    assert (path.name, path.stem, path.suffix) == ("c.tar.gz", "c.tar", ".gz")
    assert str(path.parent / "d" / "e") == url.replace("c.tar.gz", "d/e")
    assert str(path.with_name("d.png").with_suffix(".jpg")) == url.replace("c.tar.gz", "d.jpg")
    assert path == path_of(url)
    assert len({path, path_of(url)}) == 1
    assert path.relative_to(path.parent.parent).as_posix() == "a/c.tar.gz"
    assert path.resolve() == path.absolute() == path
    assert path_of(Path(url)) == path  # as an option of the type Path would shorten it
    again = pickle.loads(pickle.dumps(path))
    assert isinstance(again, RemotePath)
    assert str(again) == url


@settings(max_examples=25)
@given(st.lists(NAMES.filter(lambda name: name not in (".", "..")), min_size=1, max_size=4))
def test_any_name_is_kept(names: list[str]) -> None:
    path = path_of("s3://b").joinpath(*names)
    assert str(path) == "/".join(["s3://b", *names])
    assert path.name == names[-1]


@pytest.mark.parametrize("name", ["../a", "/etc/passwd", "a/../../b", "..", "s3://other/a/../.."])
def test_names_of_tables_stay_inside(name: str) -> None:
    with pytest.raises(DataError, match=r"s3://b/data: the file name '.*' leads out of this folder"):
        files.inside(path_of("s3://b/data"), name)


def test_local_paths_stay_what_they_are(tmp_path: Path) -> None:
    assert path_of(tmp_path) is tmp_path
    assert type(path_of("a/b")) is type(Path())
    assert path_of("file:///a%20b/c") == path_of("file://localhost/a b/c") == Path("/a b/c")


@pytest.mark.parametrize(
    ("url", "reason"),
    [
        ("https://user:secret@h/a", r"^https://\.\.\.: expected an address without user name and password"),
        ("s3://key:secret@b/a", r"^s3://\.\.\.: expected an address without user name and password"),
        ("https://h/a?signature=secret", r"^https://h/a: expected no query in the address"),
        ("ftp://h/a", r"^ftp://\.\.\.: expected a path or a URL of s3://, gs://, http://, https://, file://$"),
        ("file://host/a", "expected file:///PATH on this machine"),
    ],
)
def test_urls_that_cannot_be(url: str, reason: str) -> None:
    with pytest.raises(DataError, match=reason) as caught:
        path_of(url)
    assert "secret" not in str(caught.value)


def test_questions_and_lists(s3: S3Server) -> None:
    s3.client().create_bucket(Bucket="made")
    root = path_of("s3://made")
    for name in ("v/a.json", "v/b.json", "bev/x/1.npz", "bev/y/deep/2.npz", "top", "v/"):
        s3.client().put_object(Bucket="made", Key=name, Body=b"12")
    assert [(path.name, path.is_dir(), path.is_file()) for path in root.iterdir()] == [
        ("bev", True, False),
        ("top", False, True),
        ("v", True, False),
    ]
    assert [path.name for path in (root / "v").iterdir()] == ["a.json", "b.json"]
    assert [str(path) for path in root.glob("*/a.json")] == ["s3://made/v/a.json"]
    assert [path.name for path in root.glob("bev/*/")] == ["x", "y"]
    assert [path.name for path in root.glob("bev/*/[!.]*.npz")] == ["1.npz"]
    assert [str(path) for path in root.rglob("*.npz")] == ["s3://made/bev/x/1.npz", "s3://made/bev/y/deep/2.npz"]
    assert [path.name for path in (root / "bev").rglob("2*")] == ["2.npz"]
    assert list((root / "none").rglob("*")) == []
    assert list(root.glob("none/*")) == list((root / "none").iterdir()) == []
    state = (root / "top").stat()
    assert (state.st_size, state.st_mtime_ns > 10**18) == (2, True)
    assert not (root / "nothing").exists()
    with pytest.raises(FileNotFoundError):
        (root / "nothing").stat()
    (root / "top").unlink()
    (root / "top").unlink()
    assert not (root / "top").exists()


def test_it_is_not_opened_as_a_local_file() -> None:
    with pytest.raises(files.StoreError, match=r"s3://b/a: expected a path on this machine, got a URL"):
        path_of("s3://b/a").write_bytes(b"")


def test_tables_are_fetched_once_and_again_when_they_change(s3: S3Server) -> None:
    s3.client().create_bucket(Bucket="made")
    path = path_of("s3://made/a.json")
    files.write_json(path, [1])
    for _ in range(3):
        assert files.read_json(path) == [1]
    assert s3.requests.count("GET /made/a.json") == 1
    files.write_json(path, [2])
    assert files.read_json(path) == [2]
    assert s3.requests.count("GET /made/a.json") == 2
    copy = files.local_copy(path)
    assert list(copy.parent.iterdir()) == [copy]
    with pytest.raises(DataError, match=r"s3://made/none\.json: cannot be read \(no such file\)"):
        files.read_json(path.with_name("none.json"))
