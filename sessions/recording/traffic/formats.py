"""Format versions of sessions, and conversion of older ones.

Each version has one converter to the next version; reading applies all that are needed, so that a converter never
changes. A recording of a newer version is refused with its name.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, TypeAlias

from drivers.core.errors import SessionDataError
from sessions.recording.traffic import raw_frames, schemas

TRAFFIC_FORMATS = ("tactile-traffic/1", "tactile-traffic/2")
MANIFEST_FORMATS = ("tactile-session/1", "tactile-session/2", "tactile-session/3")

Message: TypeAlias = tuple[str, bytes, int]
"""Topic, content as stored in the file, stamp in nanoseconds."""


def _frames_without_head(message: Message) -> Message:
    """Version 1 stored the bytes of a transport without an envelope."""
    topic, data, stamp_ns = message
    return (topic, raw_frames.encode(data, stamp_ns), stamp_ns) if schemas.is_raw(topic) else message


_TRAFFIC_CONVERTERS: Mapping[str, Callable[[Message], Message]] = {"tactile-traffic/1": _frames_without_head}


def _without_streams(content: dict[str, Any]) -> dict[str, Any]:
    """Version 1 did not store the losses of each stream."""
    return {**content, "streams": {}}


def _without_origin(content: dict[str, Any]) -> dict[str, Any]:
    """Version 2 stored only in its notes whether it was derived from another session: it counts as recorded."""
    return {**content, "derived": []}


_MANIFEST_CONVERTERS: Mapping[str, Callable[[dict[str, Any]], dict[str, Any]]] = {
    "tactile-session/1": _without_streams,
    "tactile-session/2": _without_origin,
}


def traffic_converter(written_in: str | None, where: str) -> Callable[[Message], Message]:
    """Converts messages of a version into those of the present one.

    Raises:
        SessionError: a version that this program does not know.
    """
    steps = [_TRAFFIC_CONVERTERS[version] for version in _steps(written_in, TRAFFIC_FORMATS, where)]

    def convert(message: Message) -> Message:
        for step in steps:
            message = step(message)
        return message

    return convert


def converted_manifest(content: Any, where: str) -> Any:
    """The content of ``session.yaml`` in the present version; other documents are unchanged.

    Raises:
        SessionError: a version that this program does not know.
    """
    if not isinstance(content, dict) or "format" not in content:
        return content
    for version in _steps(content["format"], MANIFEST_FORMATS, where):
        following = MANIFEST_FORMATS[MANIFEST_FORMATS.index(version) + 1]
        content = {**_MANIFEST_CONVERTERS[version](content), "format": following}
    return content


def _steps(written_in: Any, known: tuple[str, ...], where: str) -> tuple[str, ...]:
    """The versions to convert, oldest first."""
    if written_in in known:
        return known[known.index(written_in) : -1]
    if written_in is None:
        hint = "Restore it from a copy of the session"
        raise SessionDataError("does not say in which version of its format it is written", where=where, hint=hint)
    newer = _number(written_in) > _number(known[-1]) and str(written_in).startswith(known[-1].split("/")[0])
    what = "a newer version of the program" if newer else "a format that this program does not know"
    raise SessionDataError(
        f"written in {written_in!r}, {what}; this version reads {known[0]} to {known[-1]}",
        where=where,
        hint="Use the version of tactile-lab that recorded it" + (", or a newer one" if newer else ""),
    )


def _number(form: Any) -> int:
    digits = str(form).rpartition("/")[2]
    return int(digits) if digits.isascii() and digits.isdigit() else 0
