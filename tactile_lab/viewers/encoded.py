"""Messages ready for a file or a socket, with what a reader needs to know about their topic."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Schema:
    """Type of a topic's messages: name, encoding of the definition, and the definition."""

    name: str
    encoding: str
    definition: bytes


@dataclass(frozen=True)
class Topic:
    """A topic: its name, the encoding of its messages (``protobuf``, ``cdr``) and their type.

    ``lasting`` messages are true until another replaces them; ``key`` in :class:`Encoded` says which.
    """

    name: str
    encoding: str
    schema: Schema


@dataclass(frozen=True)
class Encoded:
    """One message.

    Attributes:
        key: a later message of the topic with the same key replaces this one for those who come later; None if they
            need not know it.
    """

    topic: Topic
    stamp_ns: int
    data: bytes
    key: str | None = None
