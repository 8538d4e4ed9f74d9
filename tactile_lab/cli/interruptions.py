"""No Ctrl+C is lost, whatever the program is doing when it comes.

Python raises KeyboardInterrupt wherever it happens to be, and some places forget it: trimesh takes any exception of an
import for a library that is not there, and what is raised in a finaliser or in a callback of the garbage collector is
printed and dropped. There the interruption is put off, or comes once more, until it meets a place that heeds it.
"""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

Unraisable = Callable[["sys.UnraisableHookArgs"], Any]

_AGAIN_s = 0.05
"""How soon it comes once more."""
_IMPORTS = "<frozen importlib"
_FORGETFUL = {"trimesh", "networkx"}
"""Libraries that catch every exception and go on."""


@contextmanager
def interruptions_heeded() -> Iterator[None]:
    """Within the block Ctrl+C and SIGTERM end what runs by KeyboardInterrupt; where Ctrl+C is ignored it stays so."""
    before = {number: signal.signal(number, _like_ctrl_c) for number in (signal.SIGTERM, signal.SIGALRM)}
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        before[signal.SIGINT] = signal.signal(signal.SIGINT, _on_interrupt)
    told, sys.unraisablehook = sys.unraisablehook, _remembering(sys.unraisablehook)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        sys.unraisablehook = told
        for number, handler in before.items():
            signal.signal(number, handler)


def _on_interrupt(number: int, frame: FrameType | None) -> None:
    if _would_be_forgotten(frame):
        _come_again()
    else:
        raise KeyboardInterrupt


def _like_ctrl_c(number: int, frame: FrameType | None) -> None:
    """Whoever asks the program to end gets the same careful ending as a person at the keyboard."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        _on_interrupt(number, frame)
    else:
        signal.raise_signal(signal.SIGINT)


def _remembering(told: Unraisable) -> Unraisable:
    """Hears of exceptions where none can be raised: an interruption comes again, others are told as ever."""

    def remembered(dropped: sys.UnraisableHookArgs) -> None:
        if isinstance(dropped.exc_value, KeyboardInterrupt):
            _come_again()
        else:
            told(dropped)

    return remembered


def _come_again() -> None:
    signal.setitimer(signal.ITIMER_REAL, _AGAIN_s)


def _would_be_forgotten(frame: FrameType | None) -> bool:
    """Whether something on the way out of this frame may catch the exception and go on."""
    while frame is not None:
        library = str(frame.f_globals.get("__name__", "")).partition(".")[0]
        if library in _FORGETFUL or frame.f_code.co_filename.startswith(_IMPORTS):
            return True
        frame = frame.f_back
    return False
