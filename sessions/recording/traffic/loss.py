"""What of a recording could not be read."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass
class Loss:
    """What could not be read.

    Attributes:
        truncated: the file ends too early; up to the last tenth of a second was not written.
        unreadable_bytes: bytes after the last complete record.
        damaged_chunks: chunks skipped.
        damaged_files: files stored in the recording, such as calibrations, that are not as they were.
        damaged_records: places without a record where one should begin; reading continues at the next one.
        missing_messages: gaps in the numbering of what was read.
        by_topic: messages missing by topic: in a whole file by its summary, else those of damaged chunks whose index
            could be read; part of ``missing_messages``.
    """

    truncated: bool = False
    unreadable_bytes: int = 0
    damaged_chunks: int = 0
    damaged_files: int = 0
    damaged_records: int = 0
    missing_messages: int = 0
    by_topic: dict[str, int] = field(default_factory=dict)

    def __bool__(self) -> bool:
        return bool(self.counts())

    def describe(self) -> str:
        """The loss in words; empty if nothing was lost."""
        parts = []
        if self.truncated:
            torn = f" ({self.unreadable_bytes} bytes of an incomplete record)" if self.unreadable_bytes else ""
            parts.append(f"the file ends too early{torn}")
        if self.damaged_chunks:
            parts.append(f"{_several(self.damaged_chunks, 'damaged chunk')} skipped")
        if self.damaged_files:
            parts.append(_several(self.damaged_files, "damaged file") + " stored in it")
        if self.damaged_records:
            parts.append(f"damaged in {_several(self.damaged_records, 'place')} ({self.unreadable_bytes} bytes)")
        if self.missing_messages:
            parts.append(_several(self.missing_messages, "message") + " missing")
        return "; ".join(parts)

    def counts(self) -> dict[str, int]:
        """The loss as counts by kind, for a session's manifest; empty if nothing was lost."""
        kinds = {
            "truncated": int(self.truncated),
            "unreadable_bytes": self.unreadable_bytes,
            "damaged_chunks": self.damaged_chunks,
            "damaged_files": self.damaged_files,
            "damaged_records": self.damaged_records,
            "missing_messages": self.missing_messages,
        }
        return {kind: number for kind, number in kinds.items() if number}


def _several(number: int, noun: str) -> str:
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"
