"""Linear algebra on one thread: the same result on every machine, and quicker for matrices of this size."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, wraps
from typing import ParamSpec, TypeVar

from threadpoolctl import ThreadpoolController

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")


def on_one_thread(work: Callable[Arguments, Result]) -> Callable[Arguments, Result]:
    """Let a function use one thread of the linear algebra library, whatever the caller or the environment allows.

    Sums are taken in another order on more threads, and rounding makes another trajectory of that.
    """

    @wraps(work)
    def limited(*args: Arguments.args, **kwargs: Arguments.kwargs) -> Result:
        with _controller().limit(limits=1, user_api="blas"):
            return work(*args, **kwargs)

    return limited


@cache
def _controller() -> ThreadpoolController:
    """Searching for the libraries takes milliseconds, so it is done once."""
    return ThreadpoolController()
