"""The weights that come with the package, without anything that reads them."""

from __future__ import annotations

from pathlib import Path

from appocc.files import path_of
from appocc.typing import PathLike

# The default weights; others lie beside them.
PACKAGED = Path(__file__).parent / "data" / "appocc.safetensors"
# The weights in a folder in the layout of the Hugging Face Hub.
FOLDER_FILE = "model.safetensors"


def shipped_weights() -> dict[str, Path]:
    """Return the files of the weights that come with the package, by name."""
    return {path.stem: path for path in PACKAGED.parent.glob("*.safetensors")}


def find_weights(name_or_path: PathLike) -> Path:
    """Return the file of shipped weights by their name, such as `street`, of a folder of weights, or another file."""
    path = shipped_weights().get(str(name_or_path)) or path_of(name_or_path)
    # Any address of a web server may be a folder.
    return path / FOLDER_FILE if path.suffix != ".safetensors" and path.is_dir() else path
