"""The common base of emulators: context managers that close themselves."""

from __future__ import annotations

from typing import Self


class Closing:
    """Closed when its context ends."""

    def close(self) -> None:
        """Close it; idempotent."""
        raise NotImplementedError

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *ended: object) -> None:
        self.close()
