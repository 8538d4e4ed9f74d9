"""Standard output and standard error that may go away while the program runs: a closed pipe, a terminal that is gone.

Nobody reads any more, but the session continues and is recorded. What could not be written is remembered, for the exit
code.
"""

from __future__ import annotations

import errno
import os
import sys
from typing import Literal, TextIO

GONE = (errno.EPIPE, errno.EIO, errno.EBADF)
"""The reader has closed the pipe, or the terminal has gone: no failure of the program."""
UNWRITABLE = (*GONE, errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
"""A stream that cannot be written any more."""


def open_missing_streams() -> None:
    """Put the null device in the place of each standard stream that was closed before the program began.

    Else the next file that is opened, a recording for instance, takes its number, and a library that writes to
    standard error writes into it.
    """
    for descriptor, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(descriptor)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # the lowest number that is free, hence this one
            setattr(sys, name, open(descriptor, "r" if descriptor == 0 else "w", closefd=False))  # noqa: SIM115


class LastingStream:
    """A standard stream that is written as long as it is there; afterwards nothing happens.

    Args:
        name: of the stream in :mod:`sys`, looked up at each use.
    """

    def __init__(self, name: Literal["stdout", "stderr"]) -> None:
        self._name = name
        self.failure: OSError | None = None
        """Why it cannot be written any more; None while it can."""

    @property
    def _stream(self) -> TextIO | None:
        stream = getattr(sys, self._name)
        shown: TextIO | None = getattr(stream, "rich_proxied_file", stream)  # behind a live display's own stream
        return shown

    @property
    def encoding(self) -> str:
        """As of the stream."""
        return getattr(self._stream, "encoding", None) or "utf-8"

    def isatty(self) -> bool:
        """Whether it is a terminal."""
        return self._stream is not None and not self._stream.closed and self._stream.isatty()

    def fileno(self) -> int:
        """Its descriptor. Raises OSError when there is none."""
        if self._stream is None:
            raise OSError(errno.EBADF, os.strerror(errno.EBADF))
        return self._stream.fileno()

    def write(self, text: str) -> int:
        """Write, or do nothing."""
        if self._stream is not None and self.failure is None:
            try:
                self._stream.write(self._shown(text))
            except OSError as error:
                self.give_up(error)
        return len(text)

    def _shown(self, text: str) -> str:
        """With escapes for characters that its encoding does not have."""
        return text.encode(self.encoding, "backslashreplace").decode(self.encoding)

    def flush(self) -> None:
        """Flush, or do nothing."""
        if self._stream is not None and self.failure is None:
            try:
                self._stream.flush()
            except OSError as error:
                self.give_up(error)

    def give_up(self, error: OSError) -> None:
        """What Python still holds of it goes to the null device, so that nothing complains at the end."""
        self.failure = error
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, self.fileno())
        os.close(null)
