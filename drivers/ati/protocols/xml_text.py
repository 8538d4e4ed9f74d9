"""XML from files and from devices, read with distrust."""

from __future__ import annotations

import xml.etree.ElementTree as ET

LARGEST = 1 << 20


def parse_xml(content: bytes) -> ET.Element:
    """The root of a document. Document types are refused: entities can read files or grow without end.

    Raises:
        ValueError: too large, with a document type or entities, or no XML; says which.
    """
    if len(content) > LARGEST:
        raise ValueError("is too large")
    text = content.replace(b"\0", b"").upper()  # also finds the words in UTF-16
    if b"<!DOCTYPE" in text or b"<!ENTITY" in text:
        raise ValueError("contains a document type or entities")
    try:
        return ET.fromstring(content)
    except (ET.ParseError, LookupError) as error:
        raise ValueError(f"is not valid XML ({error})") from error
