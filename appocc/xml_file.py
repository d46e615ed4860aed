"""XML from elsewhere, without a document type: entities can expand to gigabytes or name other files."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from pathlib import Path

from appocc.errors import DataError


def parse_xml(path: Path, text: str) -> ElementTree.Element:
    """Return the root of an XML text that was read from a file.

    Raises:
        DataError: if it has a document type or an entity, or is no valid XML.
    """
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise DataError(f"{path}: expected XML without a document type")
    try:
        return ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError) as error:
        raise DataError(f"{path}: no valid XML ({error})") from error
