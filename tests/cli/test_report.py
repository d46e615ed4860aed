"""`appocc report`: one file that is whole in itself, with the figures of the evaluation."""

from __future__ import annotations

import json
from html.parser import HTMLParser
from pathlib import Path

import pytest
from made_street_maps import write_street_maps
from tiny_dataset import TinyDataset, token
from typer.testing import CliRunner, Result

from appocc.bevmap import bev_path
from appocc.checks import ByteArray
from appocc.errors import AppoccError
from appocc.evaluation.bev import EvaluationConfig, evaluate
from appocc.nuscenes import Dataset
from appocc.visualization.layout import resized
from cli.main import app


class Page(HTMLParser):
    """Text, attributes, tags and the rows of tables of a page."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.links: list[str] = []
        self.ids: list[str] = []
        self.rows: list[list[str]] = []
        self.words = ""
        self.feed(path.read_text())

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.links += [value or "" for name, value in attrs if name in ("src", "href")]
        self.ids += [value or "" for name, value in attrs if name == "id"]
        if tag == "tr":
            self.rows.append([])
        if tag in ("td", "th"):
            self.rows[-1].append("")

    def handle_data(self, data: str) -> None:
        self.words += data
        if self.rows and self.rows[-1] and self.lasttag in ("td", "th"):
            self.rows[-1][-1] += data.strip()

    def row(self, *begin: str) -> list[str]:
        """The first row that begins with these cells."""
        return next(row for row in self.rows if row[: len(begin)] == list(begin))


@pytest.fixture
def predicted(tiny: TinyDataset) -> TinyDataset:
    """True maps, and predicted ones that misplace the car in the last frame."""
    return write_street_maps(write_street_maps(tiny), "mine", late_m=2.0)


def run(root: Path, *more: str) -> Result:
    return CliRunner().invoke(app, ["report", str(root), *more])


def made(root: Path, folder: Path, *more: str) -> Page:
    done = run(root, "--out", str(folder / "r.html"), *more)
    assert done.exit_code == 0, done.output
    return Page(folder / "r.html")


def test_the_page_is_whole_in_itself(predicted: TinyDataset, tmp_path: Path) -> None:
    page = made(predicted.root, tmp_path)
    assert "script" not in page.tags
    assert {link.split(":")[0] if not link.startswith("#") else link[:1] for link in page.links} == {"data", "#"}
    assert {link[1:] for link in page.links if link.startswith("#")} <= set(page.ids)
    assert sum(link.startswith("data:image/jpeg;base64,/9j/") for link in page.links) == 3 + 3
    assert (tmp_path / "r.html").stat().st_size < 10_000_000


def test_the_writing_in_pictures_is_not_reduced(
    predicted: TinyDataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scales: list[float] = []

    def note(picture: ByteArray, scale: float) -> ByteArray:
        scales.append(scale)
        return resized(picture, scale)

    monkeypatch.setattr("cli.report.pictures.resized", note)
    made(predicted.root, tmp_path)
    assert set(scales) == {1.0}


def test_the_figures_are_those_of_the_evaluation(predicted: TinyDataset, tmp_path: Path) -> None:
    page = made(predicted.root, tmp_path)
    dataset = Dataset(predicted.root)
    found = evaluate(dataset, dataset.scenes, EvaluationConfig("mine", "groundtruth"), lambda _: None).as_json()
    shown = page.row("all")
    assert shown[1:4] == ["100.0", f"{100 * found['iou_at_threshold']['vehicle']:.1f}", "–"]
    assert shown[4] == f"{found['appearance_l1']:.1f}"
    assert 50 < 100 * found["iou_at_threshold"]["vehicle"] < 90
    # The misplaced car is in the last frame.
    assert "Scene scene-tiny, key frame 2." in page.words.split("Worst frames")[-1].split("key frame 0")[0]
    assert "made-up weights, SHA-256 abc" in page.words
    assert f"appocc eval bev {predicted.root} --bev mine --against groundtruth" in page.words


def test_tracks_are_shown_where_they_are_scored(predicted: TinyDataset, tmp_path: Path) -> None:
    assert "No scores of tracks for scene-tiny (not tracked)" in made(predicted.root, tmp_path).words
    assert CliRunner().invoke(app, ["track", "scene", str(predicted.root), "--bev", "mine"]).exit_code == 0
    page = made(predicted.root, tmp_path)
    scores = json.loads((predicted.root / "tracks" / "mine" / "scene-tiny" / "metrics.json").read_text())["metrics"]
    assert page.row("scene-tiny", "all")[2:4] == [f"{100 * scores[name]:.1f}" for name in ("MOTA", "IDF1")]
    assert "No scores of tracks" not in page.words


def test_without_true_maps_the_page_says_so(predicted: TinyDataset, tmp_path: Path) -> None:
    (predicted.root / "bev" / "groundtruth").rename(tmp_path / "elsewhere")
    page = made(predicted.root, tmp_path)
    assert "the accuracy of the maps is unknown" in page.words
    assert "Without true maps no frame is known to be the worst" in page.words
    assert sum(link.startswith("data:image/jpeg") for link in page.links) == 3


def test_names_from_tables_are_escaped(predicted: TinyDataset, tmp_path: Path) -> None:
    predicted.tables["scene"][0]["name"] = "<script>alert(1)"
    predicted.write()
    page = made(predicted.root, tmp_path)
    assert "script" not in page.tags
    assert "<script>alert(1)" in page.words


def test_the_curves_of_a_training_run(predicted: TinyDataset, tmp_path: Path) -> None:
    assert "Training" not in made(predicted.root, tmp_path).words
    folder = tmp_path / "run"
    folder.mkdir()
    loss = {"step": 1, "losses": {"road": 1.0, "vehicle": 2.0, "lane": 0.5, "colour": None}}
    iou = {"best_iou": {"road": 0.5, "vehicle": 0.2, "lane": None}}
    lines = [{"kind": "train", **loss}, {"kind": "val", **loss, **iou}]
    (folder / "metrics.jsonl").write_text("\n".join(map(json.dumps, lines)))
    assert "Training" in made(predicted.root, tmp_path, "--run", str(folder)).words
    (folder / "metrics.jsonl").write_text('{"kind": "train"}\n')
    refused = run(predicted.root, "--run", str(folder), "--out", str(tmp_path / "x.html"))
    assert isinstance(refused.exception, AppoccError)
    assert "metrics.jsonl" in str(refused.exception)


@pytest.mark.parametrize("fault", ["map", "image", "scores", "name", "source"])
def test_nothing_is_written_where_something_is_missing(predicted: TinyDataset, tmp_path: Path, fault: str) -> None:
    root, out, more = predicted.root, tmp_path / "new" / "r.html", ["--bev", "mine"]
    if fault == "map":
        bev_path(root, "mine", token("sample", 1)).unlink()
    elif fault == "image":
        for path in (root / "samples" / "CAM_BACK").iterdir():
            path.write_bytes(b"no image")
    elif fault == "scores":
        scores = root / "tracks" / "mine" / "scene-tiny" / "metrics.json"
        scores.parent.mkdir(parents=True)
        scores.write_text("[]")
    elif fault == "name":
        out = out.with_suffix(".pdf")
    else:
        more = ["--bev", "theirs"]
    done = run(root, "--out", str(out), *more)
    assert isinstance(done.exception, AppoccError), done.output
    assert "\n" not in str(done.exception)
    assert not out.parent.exists()


def test_json(predicted: TinyDataset, tmp_path: Path) -> None:
    done = run(predicted.root, "--out", str(tmp_path / "r.html"), "--json", "--scene", "scene-tiny")
    answer = json.loads(done.stdout)
    assert (answer["bev"], answer["against"], answer["scenes"], answer["samples"]) == ("mine", "groundtruth", 1, 3)
    assert answer["bytes"] == (tmp_path / "r.html").stat().st_size
