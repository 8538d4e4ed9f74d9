"""``tactile-lab``: the entry point and its exit codes.

0 done. 1 begun and failed. 2 not begun: an option, or a name or file that was given, is missing or cannot be used.
3 done, but not as it should be: data or the object were lost, a result is outside its limits, some runs failed. 4 a
device is not ready. 130 interrupted.
"""

from __future__ import annotations

import errno
import gc
import os
import resource
import sys
import warnings
from collections.abc import Callable, Sequence

from drivers.core.errors import ConfigurationError, TactileLabError, refusal
from drivers.core.extensions import blamed
from tactile_lab.cli.interruptions import INTERRUPTED, interruptions_heeded, nothing_begun
from tactile_lab.cli.streams import open_missing_streams

_WORDS_OF_NO_MEMORY = (
    "can't start new thread",
    "ould not allocate memory",
    "Insufficient memory",
    "failed to map segment",
)
"""Of Python, MuJoCo, OpenCV and the loader of libraries, whose errors have no type for it."""
_NARROWEST = 20
"""Columns that a terminal has at least."""
_COLLECTED_AFTER = 10_000
"""New objects until Python looks for garbage: with its own 700, it searches for a fifth of the time of loading."""
_LEAST_ADDRESSES_bytes = 1_000_000_000
"""With less, OpenBLAS may try for ever while it is loaded, or a library ends the program without a word."""
_NO_MEMORY = "the memory is exhausted. Close other programs, or raise the limit (ulimit -v)"

# Sums of several BLAS threads come out in another order, and a replay must give the same bytes on any machine.
# The libraries read this when they are loaded, which is later; small matrices are faster with one thread anyway.
os.environ.update(OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1")
os.environ.setdefault(
    "OPENCV_IO_MAX_IMAGE_PIXELS", "100000000"
)  # a packed picture of 100 kB may claim a thousand million
if os.environ.get("COLUMNS", "").isdecimal() and int(os.environ["COLUMNS"]) < _NARROWEST:
    del os.environ["COLUMNS"]  # that of a terminal whose size nobody knew: nothing at all would be shown
os.environ.setdefault("OPENCV_LOG_LEVEL", "ERROR")  # its warnings speak of its own source lines


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line; every error that a user or an extension can cause is printed here as one line.

    Args:
        arguments: the words after ``tactile-lab``; those of the process if None.

    Raises:
        SystemExit: always, with the exit code.
    """
    gc.set_threshold(_COLLECTED_AFTER)
    warnings.showwarning = _show_warning
    open_missing_streams()
    try:
        _check_memory()
        with interruptions_heeded():
            with nothing_begun():
                from tactile_lab.cli.app import app  # here, so that Ctrl+C while it loads ends without a traceback
            _run(app, arguments)
    except TactileLabError as error:
        from tactile_lab.cli.console import complain

        complain(str(error))
        sys.exit(error.exit_code)
    except ModuleNotFoundError as error:
        from drivers.core.installed.extras import explain_missing
        from tactile_lab.cli.console import complain

        if (missing := explain_missing(error)) is None:
            raise
        complain(str(missing))
        sys.exit(missing.exit_code)
    except KeyboardInterrupt:
        sys.exit(INTERRUPTED)
    except MemoryError:
        from tactile_lab.cli.console import complain

        complain(_NO_MEMORY)
        sys.exit(1)
    except Exception as error:
        if isinstance(error, FileNotFoundError) and _folder_is_gone():
            from tactile_lab.cli.console import complain

            complain("the current folder is not there any more. Change to another one")
            sys.exit(2)
        if not (words := _NO_MEMORY if _lacks_memory(error) else blamed(error) or _unusable_path(error)):
            raise
        from tactile_lab.cli.console import complain

        complain(words)
        sys.exit(1)


def _run(app: Callable[..., None], arguments: Sequence[str] | None) -> None:
    """Run the command. Raises WriteError when its answer could not be written, whatever else it had to say."""
    from tactile_lab.cli.console import check_output

    try:
        app(arguments, prog_name="tactile-lab")
    except SystemExit as ended:
        check_output()
        if ended.code:
            raise
    check_output()
    sys.exit(0)


def _check_memory() -> None:
    """Raises ConfigurationError when the system allows this program less than its libraries need."""
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    if limit != resource.RLIM_INFINITY and limit < _LEAST_ADDRESSES_bytes:
        what = f"only {limit / 1e6:.0f} MB of memory are allowed (ulimit -v), at least 1000 are needed"
        raise ConfigurationError(what, where="tactile-lab", hint="Raise the limit")


def _lacks_memory(error: Exception) -> bool:
    """Whether the system refused memory by another error than MemoryError: for a thread's stack, or a library."""
    refused = isinstance(error, OSError) and error.errno == errno.ENOMEM
    return refused or any(words in str(error) for words in _WORDS_OF_NO_MEMORY)


def _folder_is_gone() -> bool:
    """Whether the folder in which the program stands was removed."""
    try:
        os.getcwd()  # noqa: PTH109 - what is needed is its error alone
    except FileNotFoundError:
        return True
    return False


def _unusable_path(error: Exception) -> str:
    """A file or folder that the system refused where nobody asked before; empty for any other error."""
    if not isinstance(error, OSError) or error.filename is None:
        return ""
    return f"{error.filename}: cannot be used ({refusal(error)}). Check the path, the disk and permissions"


def _show_warning(message: Warning | str, *_: object, **__: object) -> None:
    """Show Python warnings in the program's format: one line, without source text."""
    from tactile_lab.cli.console import warn

    warn(str(message))


if __name__ == "__main__":
    main()
