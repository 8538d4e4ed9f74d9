"""Programs that react to Ctrl+C even if the tests themselves were started in the background.

A shell without job control lets its background jobs ignore the signal, and everything they start inherits that.
"""

from __future__ import annotations

import sys

_HEED = "import os, signal, sys; signal.signal(signal.SIGINT, signal.SIG_DFL); os.execv(sys.argv[1], sys.argv[1:])"


def interruptible(words: list[str]) -> list[str]:
    """The words of a command that ends when it is interrupted; its program must be given by its full path."""
    return [sys.executable, "-c", _HEED, *words]
