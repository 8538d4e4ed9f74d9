"""Makes sure that no Ctrl+C is lost, whatever the program is doing.

Python raises KeyboardInterrupt wherever it happens to be, and some code swallows it: trimesh takes any exception of an
import for a missing library, and exceptions in a finaliser or a garbage collector callback are printed and dropped. In
such places the interruption is delayed or raised again until the code outside can handle it.
"""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

INTERRUPTED = 130
"""Exit code of a program that was interrupted."""

Unraisable = Callable[["sys.UnraisableHookArgs"], Any]

_AGAIN_s = 0.05
"""Delay before it is raised again."""
_IMPORTS = "<frozen importlib"
_FORGETFUL = {"trimesh", "networkx", "pydantic"}
"""Libraries that catch every exception and continue, or take it for a wrong value."""


@contextmanager
def interruptions_heeded() -> Iterator[None]:
    """Within the block Ctrl+C, SIGTERM and the end of the terminal raise KeyboardInterrupt.

    A signal that is ignored stays ignored: Ctrl+C in what a script starts in the background, SIGHUP behind ``nohup``.
    """
    before = {number: signal.signal(number, _like_ctrl_c) for number in (signal.SIGTERM, signal.SIGALRM)}
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        before[signal.SIGINT] = signal.signal(signal.SIGINT, _on_interrupt)
    if signal.getsignal(signal.SIGHUP) is signal.SIG_DFL:
        before[signal.SIGHUP] = signal.signal(signal.SIGHUP, _on_hangup)
    told, sys.unraisablehook = sys.unraisablehook, _remembering(sys.unraisablehook)
    try:
        yield
    finally:
        # Python ends by the signal, not by the exit code, after an interruption in text that a library evaluates: until
        # the next such text.
        eval("None")
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        sys.unraisablehook = told
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def nothing_begun() -> Iterator[None]:
    """Within the block an interruption leaves at once, as long as there is nothing to put in order.

    An exception would not do while libraries are loaded: some swallow it.
    """
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    for number, handler in before.items():
        if handler is not signal.SIG_IGN:
            signal.signal(number, _leave)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _leave(number: int, frame: FrameType | None) -> None:
    os._exit(INTERRUPTED)


def _on_interrupt(number: int, frame: FrameType | None) -> None:
    if _would_be_forgotten(frame):
        _come_again()
    else:
        raise KeyboardInterrupt


def _like_ctrl_c(number: int, frame: FrameType | None) -> None:
    """SIGTERM ends the program as carefully as Ctrl+C."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        _on_interrupt(number, frame)
    else:
        signal.raise_signal(signal.SIGINT)


def _on_hangup(number: int, frame: FrameType | None) -> None:
    """The terminal is gone: one request to end in order, though the system and a shell both signal it."""
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    _like_ctrl_c(number, frame)


def _remembering(told: Unraisable) -> Unraisable:
    """Called for exceptions that cannot be raised: an interruption is raised again, others are reported as usual."""

    def remembered(dropped: sys.UnraisableHookArgs) -> None:
        if isinstance(dropped.exc_value, KeyboardInterrupt):
            _come_again()
        else:
            told(dropped)

    return remembered


def _come_again() -> None:
    signal.setitimer(signal.ITIMER_REAL, _AGAIN_s)


def _would_be_forgotten(frame: FrameType | None) -> bool:
    """Whether a caller of this frame may catch the exception and continue."""
    while frame is not None:
        library = str(frame.f_globals.get("__name__", "")).partition(".")[0]
        if library in _FORGETFUL or frame.f_code.co_filename.startswith(_IMPORTS):
            return True
        frame = frame.f_back
    return False
