"""Memory that is free inside of this process, for others."""

from __future__ import annotations

import ctypes


def return_freed_memory() -> None:
    """Give freed memory back to the system, where its C library can do that.

    The library keeps what large arrays took, in pieces that do not fit the next, somewhat larger ones: resident memory
    then grows with every grasp though nothing is kept.
    """
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:
        trim(0)
