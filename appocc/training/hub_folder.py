"""Weights as a folder in the layout of the Hugging Face Hub: model.safetensors, config.json and a model card."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import yaml

from appocc.bevmap import CLASSES
from appocc.errors import AppoccError, DataError
from appocc.extras import import_extra
from appocc.files import open_plain, read_json, whole_file, write_bytes, write_json
from appocc.models.shipped import FOLDER_FILE, PACKAGED
from appocc.training.shipping import describe_weights

SCHEME = "hf://"
_CONFIG, _CARD = "config.json", "README.md"
# Entries of the model card that describe the network; config.json repeats them for readers without safetensors.
_KEYS = ("network", "setting", "view", "appearance", "parts", "thresholds", "object_threshold", "version")
# Documents that may lie beside the weights, and hidden files such as .git and .gitattributes. Nothing else: files of
# other endings may be pickles or code, which other programs would run.
_DOCUMENTS = (".md", ".txt", ".png", ".jpg", "")
_TAGS = ("bird-eye-view", "autonomous-driving", "occupancy", "surround-view", "robotics", "appocc")


def push_weights(source: Path, target: str, licence: str | None = None) -> str:
    """Write a weights file as a folder, or upload it as a model repository; return where it is.

    Args:
        source: weights file.
        target: folder, new or one of weights, which is updated; or `hf://OWNER/NAME[@REVISION]`.
        licence: identifier of the licence on the model card; None: MIT for the weights of the package, else unknown.

    Raises:
        DataError: if the weights are missing or damaged, the folder has other content or cannot be written, or the
            repository name is not valid.
        AppoccError: if the extra `hub` is missing or the upload fails.
    """
    if not target.startswith(SCHEME):
        _write(source, Path(target), Path(target).absolute().name, licence)
        return target
    repository, revision = _repository(target)
    with TemporaryDirectory() as folder:
        _write(source, Path(folder), repository, licence)
        with _hub(target) as hub:
            api = hub.HfApi()
            api.create_repo(repository, exist_ok=True)
            api.upload_folder(repo_id=repository, folder_path=folder, revision=revision)
    return f"https://huggingface.co/{repository}"


def pull_weights(source: str, out: Path) -> None:
    """Write the weights of a folder or a model repository to a file, byte by byte as they were pushed.

    Args:
        source: folder, such as a clone, or `hf://OWNER/NAME[@REVISION]`.
        out: new file, `*.safetensors`.

    Raises:
        DataError: if files are missing, damaged or not of these weights, the folder has others that may hold code, or
            `out` has another suffix or cannot be written.
        AppoccError: if the extra `hub` is missing or the download fails.
    """
    if out.suffix != ".safetensors":
        raise DataError(f"{out}: expected a name that ends in .safetensors")
    if not source.startswith(SCHEME):
        _copy_checked(Path(source), out)
        return
    repository, revision = _repository(source)
    names = [FOLDER_FILE, _CONFIG, _CARD]
    with TemporaryDirectory() as folder:
        with _hub(source) as hub:
            hub.snapshot_download(repository, revision=revision, local_dir=folder, allow_patterns=names)
        _copy_checked(Path(folder), out)


def _write(source: Path, folder: Path, name: str, licence: str | None) -> None:
    """Write the three files of a folder; each is whole at any time."""
    card = describe_weights(source)
    if folder.exists() and _checked_entries(folder) and not (folder / FOLDER_FILE).is_file():
        raise DataError(f"{folder}: expected a new folder or one with {FOLDER_FILE}, got one with other files")
    write_json(folder / _CONFIG, _config(card))
    allowed = licence or ("mit" if source.parent == PACKAGED.parent else "unknown")
    write_bytes(folder / _CARD, model_card(card, name, allowed).encode())
    _copy(source, folder / FOLDER_FILE)


def _copy_checked(folder: Path, out: Path) -> None:
    _checked_entries(folder)
    card = describe_weights(folder / FOLDER_FILE)
    wanted, got = _config(card), read_json(folder / _CONFIG)
    if not isinstance(got, dict):
        raise DataError(f"{folder / _CONFIG}: expected a JSON object, got {type(got).__name__}")
    for key in wanted:
        if got.get(key) != wanted[key]:
            expected = f"expected {json.dumps(wanted[key])} as in {FOLDER_FILE}"
            raise DataError(f"{folder / _CONFIG}: {key}: {expected}, got {json.dumps(got.get(key))[:80]}")
    _copy(folder / FOLDER_FILE, out)


def _copy(source: Path, out: Path) -> None:
    with open_plain(source) as file, whole_file(out) as temporary, temporary.open("wb") as target:
        shutil.copyfileobj(file, target)


def _checked_entries(folder: Path) -> list[Path]:
    """Return the visible files of a folder, which are weights and documents only.

    Raises:
        DataError: if it is no folder or holds something else.
    """
    if not folder.is_dir():
        raise DataError(f"{folder}: expected a folder with {FOLDER_FILE} and {_CONFIG}, got none")
    entries = [path for path in sorted(folder.iterdir()) if not path.name.startswith(".")]
    for path in entries:
        known = path.name in (FOLDER_FILE, _CONFIG) or path.suffix in _DOCUMENTS
        if path.is_dir() or not known:
            raise DataError(f"{path}: expected {FOLDER_FILE}, {_CONFIG} and documents only; others may hold code")
    return entries


def _config(card: Mapping[str, Any]) -> dict[str, Any]:
    """Return the contents of config.json; `model_type` is what the Hub shows and counts downloads by."""
    return {"model_type": "appocc", **{key: card[key] for key in _KEYS if key in card}}


def _repository(text: str) -> tuple[str, str | None]:
    """Return name and revision of `hf://OWNER/NAME[@REVISION]`."""
    name, _, revision = text.removeprefix(SCHEME).partition("@")
    if len(name.split("/")) != 2 or not all(name.split("/")):
        raise DataError(f"{text}: expected {SCHEME}OWNER/NAME or {SCHEME}OWNER/NAME@REVISION")
    return name, revision or None


@contextmanager
def _hub(name: str) -> Iterator[Any]:
    """Yield `huggingface_hub`; its errors become one line."""
    hub = import_extra("huggingface_hub", "hub", name)
    try:
        yield hub
    except Exception as error:  # of its own, of its network library and of the operating system
        raise AppoccError(f"{name}: {' '.join(str(error).split())[:300]}") from error


# The model card ----------------------------------------------------------------------------------------------------


def model_card(card: Mapping[str, Any], name: str, licence: str) -> str:
    """Return README.md of a model repository: YAML metadata of the Hub, then Markdown.

    The metadata follow https://github.com/huggingface/hub-docs/blob/main/modelcard.md.

    Args:
        card: model card as `describe_weights` returns it.
        name: name of the model.
        licence: identifier of the licence.
    """
    head: dict[str, Any] = {
        "license": licence,
        "library_name": "appocc",
        "pipeline_tag": "image-segmentation",
        "tags": list(_TAGS),
        "metrics": ["mean_iou"],
    }
    figures = card.get("figures")
    if figures:
        head["model-index"] = [{"name": name, "results": [_result(figures)]}]
    return f"---\n{yaml.safe_dump(head, sort_keys=False, allow_unicode=True)}---\n\n{_text(card, name)}"


def _result(figures: Mapping[str, Any]) -> dict[str, Any]:
    """Return the figures of `eval bev` as an entry of model-index; shares of 1."""
    iou = _iou(figures).items()
    metrics = [{"type": "mean_iou", "name": f"IoU {kind}", "value": share} for kind, share in iou]
    name = f"{figures['samples']} key frames of unseen places"
    return {
        "task": {"type": "image-segmentation", "name": "bird's-eye-view segmentation"},
        "dataset": {"type": "nuscenes-schema", "name": name},
        "metrics": metrics,
    }


def _iou(figures: Mapping[str, Any]) -> dict[str, float]:
    shares = figures.get("iou_at_threshold") or figures["iou"]
    return {kind: round(shares[kind], 4) for kind in CLASSES if shares.get(kind) is not None}


def _text(card: Mapping[str, Any], name: str) -> str:
    """Return the Markdown of the model card."""
    view, grid = card["view"], card["view"]["grid"]
    metres = f"{grid[1] - grid[0]:g} x {grid[3] - grid[2]:g} m at {grid[4]:g} m"
    parts = "".join(f", {part}" for part in card.get("parts", ()))
    rows = [
        ("network", f"`{card['network']}`{parts}; {card['parameters'] / 1e6:.1f} million parameters"),
        ("input", f"{len(view['channels'])} cameras, {view['size_px'][0]} x {view['size_px'][1]} pixels"),
        ("output", f"{', '.join(CLASSES)}{' and colour' if card['appearance'] else ''} of {metres}"),
        ("decision thresholds", ", ".join(f"{k} {t:g}" for k, t in zip(CLASSES, card["thresholds"], strict=True))),
    ]
    if card.get("figures"):
        shares = ", ".join(f"{kind} {100 * share:.1f} %" for kind, share in _iou(card["figures"]).items())
        rows.append((f"IoU on {card['figures']['samples']} key frames of unseen places", shares))
    if card.get("step") is not None:
        rows.append(("training", f"{card['step']} steps"))
    table = "".join(f"| {key} | {value} |\n" for key, value in rows)
    made = "".join(f"    {command}\n" for command in card.get("commands", ()))
    return (
        f"# {name}\n\nBird's-eye-view occupancy and colour from surround cameras, with `appocc`.\n\n"
        f"| | |\n|---|---|\n{table}\n"
        f"In a copy of this folder: `appocc infer ROOT --weights . --out ROOT/bev/predicted`.\n"
        + (f"\nMade by:\n\n{made}" if made else "")
        + (f"\n{card['attribution']}\n" if card.get("attribution") else "")
    )
