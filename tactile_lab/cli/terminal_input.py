"""Non-blocking terminal input: single keys, or whole lines."""

from __future__ import annotations

import atexit
import codecs
import os
import select
import sys
import termios
import time
from contextlib import suppress
from types import TracebackType
from typing import Any, Self

_LFLAG, _IFLAG, _CC = 3, 0, 6


class KeyInput:
    """Single keys from a terminal, not echoed; a context manager that always restores the terminal.

    Ctrl+C still interrupts. Ctrl+Z and Ctrl+S have no effect in the context: a program that moves a hand must not be
    suspended by a key.

    Args:
        descriptor: of the terminal; standard input unless given.
    """

    def __init__(self, descriptor: int | None = None) -> None:
        self._descriptor = sys.stdin.fileno() if descriptor is None else descriptor
        self._before: list[Any] | None = None
        self._decoder = codecs.getincrementaldecoder("utf-8")("replace")
        self.closed = False
        """The terminal is gone."""

    def __enter__(self) -> Self:
        self._before = termios.tcgetattr(self._descriptor)
        changed = termios.tcgetattr(self._descriptor)
        changed[_LFLAG] &= ~(termios.ICANON | termios.ECHO)
        changed[_IFLAG] &= ~termios.IXON
        changed[_CC][termios.VSUSP] = b"\x00"
        changed[_CC][termios.VMIN], changed[_CC][termios.VTIME] = b"\x00", b"\x00"
        atexit.register(self.restore)
        termios.tcsetattr(self._descriptor, termios.TCSADRAIN, changed)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.restore()
        atexit.unregister(self.restore)

    def restore(self) -> None:
        """Restore the terminal; can be called repeatedly."""
        before, self._before = self._before, None
        if before is not None and not self.closed:
            with suppress(termios.error):  # the terminal is gone
                termios.tcsetattr(self._descriptor, termios.TCSADRAIN, before)

    def read(self) -> str:
        """Keys typed since the last call."""
        data = _waiting_bytes(self._descriptor)
        self.closed = self.closed or data is None
        return self._decoder.decode(data or b"")


class LineInput:
    """Whole lines from standard input: a simple terminal, or a pipe. None if there is no such input.

    Args:
        descriptor: where to read; standard input unless given.
    """

    def __init__(self, descriptor: int | None = None) -> None:
        self._decoder = codecs.getincrementaldecoder("utf-8")("replace")
        self._rest = ""
        self.closed = False
        """Whether the end of the input was reached."""
        try:
            self._descriptor = sys.stdin.fileno() if descriptor is None else descriptor
        except (AttributeError, OSError, ValueError):  # closed before the program began
            self.closed = True

    def wait(self, seconds: float) -> None:
        """Wait until something can be read, at most this long. Without an input, wait the full time.

        The time is always limited: a Ctrl+C that arrives between Python's last check for signals and the system call
        does not end the call.
        """
        if not self.closed:
            select.select([self._descriptor], [], [], seconds)
        elif seconds:
            time.sleep(seconds)

    def lines(self) -> list[str]:
        """Lines typed since the last call: complete ones, and at the end of the input the remainder."""
        if self.closed:
            return []
        data = _waiting_bytes(self._descriptor)
        self.closed = data is None
        *lines, self._rest = (self._rest + self._decoder.decode(data or b"")).split("\n")
        return [*lines, self._rest] if self.closed and self._rest else lines


def _waiting_bytes(descriptor: int) -> bytes | None:
    """What can be read without waiting, b"" for nothing; None at the end of the input."""
    try:
        if not select.select([descriptor], [], [], 0)[0]:
            return b""
        return os.read(descriptor, 4096) or None
    except OSError:  # a terminal that was closed reads as an input/output error
        return None
