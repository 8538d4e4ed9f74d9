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
        damaged_records: places without a record where one should begin; reading continues at the next one.
        missing_messages: gaps in the numbering of what was read.
        by_topic: messages missing by topic: in a whole file by its summary, else those of damaged chunks whose index
            could be read; part of ``missing_messages``.
    """

    truncated: bool = False
    unreadable_bytes: int = 0
    damaged_chunks: int = 0
    damaged_records: int = 0
    missing_messages: int = 0
    by_topic: dict[str, int] = field(default_factory=dict)

    def __bool__(self) -> bool:
        return self.truncated or self.damaged_chunks > 0 or self.damaged_records > 0 or self.missing_messages > 0

    def describe(self) -> str:
        """The loss in words; empty if nothing was lost."""
        parts = []
        if self.truncated:
            torn = f" ({self.unreadable_bytes} bytes of an incomplete record)" if self.unreadable_bytes else ""
            parts.append(f"the file ends too early{torn}")
        if self.damaged_chunks:
            parts.append(f"{self.damaged_chunks} damaged chunks skipped")
        if self.damaged_records:
            parts.append(f"damaged in {self.damaged_records} more places ({self.unreadable_bytes} bytes)")
        if self.missing_messages:
            parts.append(f"{self.missing_messages} messages missing")
        return "; ".join(parts)

    def counts(self) -> dict[str, int]:
        """The loss as counts by kind, for a session's manifest; empty if nothing was lost."""
        kinds = {
            "truncated": int(self.truncated),
            "unreadable_bytes": self.unreadable_bytes,
            "damaged_chunks": self.damaged_chunks,
            "damaged_records": self.damaged_records,
            "missing_messages": self.missing_messages,
        }
        return {kind: number for kind, number in kinds.items() if number}
