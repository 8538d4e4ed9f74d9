"""Loading the heavy libraries without losing a Ctrl+C."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager

_ENDINGS = {signal.SIGINT, signal.SIGTERM}


@contextmanager
def interruptions_held() -> Iterator[None]:
    """Hold Ctrl+C back until the block is done: some libraries swallow it while they are imported."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, _ENDINGS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
