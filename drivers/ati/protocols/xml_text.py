"""Reads XML from files and devices, which are not trusted."""

from __future__ import annotations

import xml.etree.ElementTree as ET

LARGEST = 1 << 20


def parse_xml(content: bytes) -> ET.Element:
    """The root of a document. Document types are refused, because entities can read files or expand without limit.

    Raises:
        ValueError: the text is too large, has a document type or entities, or is not XML; the message says which.
    """
    if len(content) > LARGEST:
        raise ValueError("is too large")
    text = content.replace(b"\0", b"").upper()  # also finds these words in UTF-16
    if b"<!DOCTYPE" in text or b"<!ENTITY" in text:
        raise ValueError("contains a document type or entities")
    try:
        return ET.fromstring(content)
    except (ET.ParseError, LookupError) as error:
        raise ValueError(f"is not valid XML ({error})") from error
