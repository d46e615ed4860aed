"""Importers: recordings of published datasets and recorders to the nuScenes schema, one module or package a format.

An importer reads its format as `Log`s; `import_logs` writes them.
"""

from __future__ import annotations

from appocc.importers.importing import Summary, import_logs
from appocc.importers.log import Frame, Image, Log, Sweep, key_indices

__all__ = ["Frame", "Image", "Log", "Summary", "Sweep", "import_logs", "key_indices"]
