"""Files: names that stay below their root, writes that are whole or not at all, pictures that are checked."""

from __future__ import annotations

import gzip
import os
import pickle
import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image, UnidentifiedImageError

from appocc import files
from appocc.checks import ByteArray
from appocc.errors import DataError

PICTURE = np.arange(4 * 6 * 3, dtype=np.uint8).reshape(4, 6, 3)


@pytest.mark.parametrize("name", ["a.jpg", "samples/CAM_FRONT/a b.jpg", "./a", "a/./b", "..a/b", "a..b", "a//b"])
def test_names_that_stay_inside(tmp_path: Path, name: str) -> None:
    assert files.inside(tmp_path, name) == tmp_path / name


@pytest.mark.parametrize(
    "name", ["", ".", "./", "..", "../a", "a/../../b", "a/..", "/etc/passwd", "//x", "\\x", "a\\..\\..\\b", "a\0b"]
)
def test_names_that_lead_out(tmp_path: Path, name: str) -> None:
    with pytest.raises(DataError, match="leads out of this folder"):
        files.inside(tmp_path, name)


@given(st.lists(st.sampled_from(["..", ".", "a", "", "..."]), max_size=6).map("/".join))
def test_no_name_that_is_let_through_means_a_place_outside(name: str) -> None:
    root = Path("/data/set")
    if files.stays_inside(name):
        assert root in Path(os.path.normpath(root / name)).parents


def test_a_folder_below_the_root_may_lie_on_another_disk(tmp_path: Path) -> None:
    (tmp_path / "disk").mkdir()
    (tmp_path / "disk" / "a.txt").write_text("x")
    (tmp_path / "root").mkdir()
    (tmp_path / "root" / "samples").symlink_to(tmp_path / "disk")
    assert files.inside(tmp_path / "root", "samples/a.txt").read_text() == "x"


def test_a_write_makes_its_folders_and_leaves_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "a" / "b" / "c.bin"
    files.write_bytes(path, b"123")
    assert path.read_bytes() == b"123"
    assert list(path.parent.iterdir()) == [path]
    assert path.stat().st_mode & 0o777 == 0o644


def _break_off(path: Path) -> None:
    with files.whole_file(path) as temporary:
        temporary.write_text("ne")
        raise KeyboardInterrupt


def test_a_write_that_is_broken_off_leaves_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_text("old")
    with pytest.raises(KeyboardInterrupt):
        _break_off(path)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_folder_that_cannot_be_made(tmp_path: Path) -> None:
    (tmp_path / "a").write_text("a file")
    with pytest.raises(DataError, match=r"a/b\.txt: cannot be written"):
        files.write_bytes(tmp_path / "a" / "b.txt", b"")


def test_a_place_that_cannot_be_taken(tmp_path: Path) -> None:
    (tmp_path / "a" / "full").mkdir(parents=True)
    with pytest.raises(DataError, match="a: cannot be written"):
        files.write_bytes(tmp_path / "a", b"x")
    assert [path.name for path in tmp_path.iterdir()] == ["a"]


@given(st.recursive(st.none() | st.booleans() | st.integers() | st.text(), lambda part: st.lists(part, max_size=3)))
def test_json_there_and_back(tmp_path_factory: pytest.TempPathFactory, value: object) -> None:
    path = tmp_path_factory.mktemp("json") / "a.json"
    files.write_json(path, value)
    assert files.read_json(path) == value
    assert path.read_bytes().endswith(b"\n")


def test_json_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"none\.json: cannot be read \(No such file"):
        files.read_json(tmp_path / "none.json")
    (tmp_path / "half.json").write_text('{"a": [1, ')
    with pytest.raises(DataError, match=r"half\.json: no valid JSON \("):
        files.read_json(tmp_path / "half.json")


def test_pictures_are_rgb_and_kept_exactly_in_png(tmp_path: Path) -> None:
    files.write_image(tmp_path / "a.png", PICTURE)
    np.testing.assert_array_equal(files.read_image(tmp_path / "a.png"), PICTURE)


def test_jpeg_keeps_the_order_of_colours(tmp_path: Path) -> None:
    files.write_image(tmp_path / "a.jpg", np.full((16, 16, 3), (200, 100, 30), np.uint8))
    read = files.read_image(tmp_path / "a.jpg").astype(int)
    assert np.abs(read - [200, 100, 30]).max() <= 6


def test_grey_pictures_are_written_and_read_as_rgb(tmp_path: Path) -> None:
    files.write_image(tmp_path / "a.png", PICTURE[..., 0])
    np.testing.assert_array_equal(files.read_image(tmp_path / "a.png")[..., 2], PICTURE[..., 0])


def test_pictures_that_cannot_be_written(tmp_path: Path) -> None:
    for name, picture in (
        ("a.xyz", PICTURE),
        ("a.jpg", np.zeros((1, 70_000, 3), np.uint8)),
        ("b.png", np.zeros((0, 4, 3), np.uint8)),
    ):
        with pytest.raises(DataError, match=rf"{name}: an image of shape \(.*\) cannot be written as '\.\w+'"):
            files.write_image(tmp_path / name, picture)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("ending", [".jpg", ".png"])
@pytest.mark.parametrize("share", [0.1, 0.6, 0.98])
def test_truncated_pictures_are_refused(tmp_path: Path, ending: str, share: float) -> None:
    path = tmp_path / f"a{ending}"
    files.write_image(path, np.random.default_rng(1).integers(0, 255, (64, 64, 3), np.uint8))
    path.write_bytes(path.read_bytes()[: int(path.stat().st_size * share)])
    with pytest.raises(DataError, match="the image is truncated" if ending == ".jpg" else "not a readable image"):
        files.read_image(path)


def noise(height: int = 64, width: int = 64) -> ByteArray:
    return np.random.default_rng(1).integers(0, 255, (height, width, 3), np.uint8)


@pytest.mark.parametrize("share", [0.3, 0.6, 0.9])
@pytest.mark.parametrize("grey", [False, True])
def test_a_jpeg_that_is_cut_and_given_an_end_mark_is_refused(tmp_path: Path, share: float, grey: bool) -> None:
    path = tmp_path / "a.jpg"
    files.write_image(path, noise()[..., 0] if grey else noise(61, 77))
    path.write_bytes(path.read_bytes()[: int(path.stat().st_size * share)] + b"\xff\xd9")
    with pytest.raises(DataError, match=r"a\.jpg: the image is truncated \(its end mark comes too early\)"):
        files.read_image(path)


def test_a_jpeg_with_bytes_after_its_end_is_whole(tmp_path: Path) -> None:
    path = tmp_path / "a.jpg"
    files.write_image(path, noise())
    whole = files.read_image(path)
    path.write_bytes(path.read_bytes() + bytes(1000))
    np.testing.assert_array_equal(files.read_image(path), whole)


def test_a_jpeg_of_the_grey_that_stands_for_what_is_missing_is_whole(tmp_path: Path) -> None:
    picture = noise()
    picture[32:, 32:] = 128
    files.write_image(tmp_path / "a.jpg", picture)
    assert (files.read_image(tmp_path / "a.jpg")[-1, -1] == 128).all()
    files.write_image(tmp_path / "b.jpg", np.full((8, 1, 3), 128, np.uint8))
    assert (files.read_image(tmp_path / "b.jpg") == 128).all()


def test_the_end_mark_of_a_thumbnail_is_none_of_the_picture(tmp_path: Path) -> None:
    path = tmp_path / "a.jpg"
    files.write_image(path, noise())
    data = path.read_bytes()
    thumbnail = b"\xff\xe1" + (2 + 40).to_bytes(2, "big") + b"\xff\xd8" + bytes(36) + b"\xff\xd9"
    path.write_bytes(data[:2] + thumbnail + data[2:])
    assert files.read_image(path).shape == (64, 64, 3)
    path.write_bytes(path.read_bytes()[: -len(data) // 3])
    with pytest.raises(DataError, match="the image is truncated"):
        files.read_image(path)


def test_what_is_no_picture(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"none\.jpg: cannot be read \(No such file"):
        files.read_image(tmp_path / "none.jpg")
    for name, data in (("empty.jpg", b""), ("text.jpg", b"hello")):
        (tmp_path / name).write_bytes(data)
        with pytest.raises(DataError, match=rf"{name}: not a readable image \({len(data)} bytes\)"):
            files.read_image(tmp_path / name)


def test_a_picture_of_another_size_than_expected(tmp_path: Path) -> None:
    files.write_image(tmp_path / "a.png", PICTURE)
    assert files.read_image(tmp_path / "a.png", (6, 4)).shape == (4, 6, 3)
    with pytest.raises(DataError, match=r"a\.png: expected 4x6 pixels, as its table says, got 6x4"):
        files.read_image(tmp_path / "a.png", (4, 6))


def test_a_few_bytes_that_claim_to_be_a_huge_picture(tmp_path: Path) -> None:
    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", 100_000, 100_000, 8, 2, 0, 0, 0)
    parts = chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(b"0")) + chunk(b"IEND", b"")
    (tmp_path / "a.png").write_bytes(b"\x89PNG\r\n\x1a\n" + parts)
    with pytest.raises(DataError, match=r"a\.png: not a readable image"):
        files.read_image(tmp_path / "a.png")


def test_deeply_nested_json_is_damaged_json(tmp_path: Path) -> None:
    (tmp_path / "deep.json").write_text("[" * 100_000)
    with pytest.raises(DataError, match=r"deep\.json: no valid JSON \("):
        files.read_json(tmp_path / "deep.json")


def test_folders_made_for_a_file_go_with_it(tmp_path: Path) -> None:
    (tmp_path / "old").mkdir()
    for path in (tmp_path / "a" / "b" / "c.txt", tmp_path / "old" / "c.txt"):
        with pytest.raises(KeyboardInterrupt):
            _break_off(path)
    assert list(tmp_path.rglob("*")) == [tmp_path / "old"]


def test_folders_that_others_use_meanwhile_stay(tmp_path: Path) -> None:
    def broken_off() -> None:
        with files.whole_file(tmp_path / "a" / "b" / "c.txt"):
            (tmp_path / "a" / "mine.txt").touch()
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        broken_off()
    assert list(tmp_path.rglob("*")) == [tmp_path / "a", tmp_path / "a" / "mine.txt"]


def test_what_is_no_plain_file_is_not_replaced(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "folder").mkdir()
    for name in ("pipe", "folder"):
        with pytest.raises(DataError, match=f"{name}: cannot be written .not a plain file"):
            files.write_bytes(tmp_path / name, b"x")
    assert (tmp_path / "pipe").is_fifo()


def test_arrays_are_never_unpickled(tmp_path: Path) -> None:
    ran = tmp_path / "ran"

    class Evil:
        def __reduce__(self) -> tuple[Any, ...]:
            return Path.touch, (ran,)

    np.savez(tmp_path / "a.npz", evil=np.array(Evil(), dtype=object))
    (tmp_path / "b.npz").write_bytes(pickle.dumps(Evil()))
    with files.zip_arrays((tmp_path / "a.npz").read_bytes()) as data:
        assert data.files == ["evil"]
        with pytest.raises(ValueError, match="allow_pickle=False"):
            data["evil"]
    with pytest.raises(ValueError, match=r"no \.npz archive, or truncated"):
        files.zip_arrays((tmp_path / "b.npz").read_bytes())
    assert not ran.exists()


def test_what_might_never_end_is_not_read(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "device").symlink_to("/dev/zero")
    for name in ("pipe", "device"):
        for read in (files.read_file, files.read_json, files.read_image, files.read_text, files.digest_of):
            with pytest.raises(DataError, match=f"{name}: expected a plain file, got a pipe or a device"):
                read(tmp_path / name)
        with (
            pytest.raises(DataError, match=f"{name}: expected a plain file"),
            files.open_picture(tmp_path / name),
        ):
            pass
    with pytest.raises(DataError, match=r"cannot be read \(Is a directory\)"):
        files.read_file(tmp_path)
    with pytest.raises(DataError, match=r"cannot be read \(embedded null byte\)"):
        files.read_file(tmp_path / "a\0b")


def test_a_file_is_read_up_to_a_size(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(b"12345")
    assert files.read_file(tmp_path / "a", 5) == b"12345"
    with pytest.raises(DataError, match="a: expected at most 4 bytes, got 5"):
        files.read_file(tmp_path / "a", 4)
    (tmp_path / "huge").touch()
    os.truncate(tmp_path / "huge", 1 << 40)
    for read in (files.read_file, files.read_json, files.read_image, files.unzipped):
        with pytest.raises(DataError, match=r"huge: expected at most \d+ bytes, got 1099511627776"):
            read(tmp_path / "huge")


def test_packed_files_hold_no_more_than_a_size(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a.gz").write_bytes(gzip.compress(bytes(1000)))
    np.savez_compressed(tmp_path / "a.npz", a=np.zeros(800, np.uint8))
    packed = (tmp_path / "a.npz").read_bytes()
    monkeypatch.setattr(files.reading, "_MOST_UNPACKED", 1000)
    assert files.unzipped(tmp_path / "a.gz") == bytes(1000)
    with files.zip_arrays(packed) as data:
        assert data["a"].shape == (800,)
    monkeypatch.setattr(files.reading, "_MOST_UNPACKED", 700)
    with pytest.raises(DataError, match=r"a\.gz: expected at most 700 bytes when unpacked, got more"):
        files.unzipped(tmp_path / "a.gz")
    with pytest.raises(ValueError, match="expected at most 700 bytes when unpacked, got 928"):
        files.zip_arrays(packed)
    (tmp_path / "b.gz").write_bytes(b"no gzip")
    with pytest.raises(DataError, match=r"b\.gz: cannot be unpacked"):
        files.unzipped(tmp_path / "b.gz")


@pytest.mark.parametrize("form", ["BMP", "GIF", "TIFF", "PPM", "WEBP", "EPS"])
def test_only_jpeg_and_png_are_read(tmp_path: Path, form: str) -> None:
    path = tmp_path / "a.png"
    Image.fromarray(PICTURE).save(path, form)
    with pytest.raises(DataError, match=r"not a readable image .* expected JPEG or PNG"):
        files.read_image(path)
    with pytest.raises(UnidentifiedImageError), files.open_picture(path):
        pass


def test_a_few_bytes_that_claim_a_huge_picture_are_refused(tmp_path: Path) -> None:
    files.write_image(tmp_path / "a.png", PICTURE)
    data = bytearray((tmp_path / "a.png").read_bytes())
    data[16:24] = struct.pack(">II", 20_000, 20_000)
    data[29:33] = struct.pack(">I", zlib.crc32(data[12:29]))
    (tmp_path / "a.png").write_bytes(data)
    with pytest.raises(DataError, match="not a readable image"):
        files.read_image(tmp_path / "a.png")
