"""Loops compiled to machine code, for the few that a profile shows to need it.

Importing this takes a large part of a second: modules with compiled loops are imported where they are called. Their
arguments are arrays and numbers only: machine code kept for a class of ours cannot be loaded after it is renamed.
They change arrays number by number: assigning a row takes some five seconds more to compile, as numba brings along
what would write both shapes into an error message.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

from numba import njit

Loop = TypeVar("Loop", bound=Callable[..., Any])


def compile_when_called(loop: Loop) -> Loop:
    """Compile a function when it is first called, and keep the machine code on disk where a folder can be written.

    One thread and no reordering of sums: the result is the same in every run, whatever the number of processors.
    """
    try:
        return cast(Loop, njit(cache=True)(loop))
    except RuntimeError:  # no folder for the machine code: it is made anew in every run
        return cast(Loop, njit(loop))
