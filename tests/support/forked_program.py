"""The command line in a copy of this process, which has loaded everything: it begins at once, and can be prepared."""

from __future__ import annotations

import json
import os
import signal
import sys
import tempfile
import traceback
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import NoReturn, TypeVar

from tactile_lab.cli.main import main

Key = TypeVar("Key")

FAILED = 70
"""Exit code when something came out that is no way to end."""


def nothing() -> None:
    """Nothing to prepare."""


def fork_program(
    words: Sequence[str], folder: Path, streams: tuple[int, int, int], prepare: Callable[[], None] = nothing
) -> int:
    """Start ``tactile-lab`` in a folder.

    Args:
        words: behind ``tactile-lab``.
        folder: to stand in.
        streams: descriptors of standard input, output and error.
        prepare: called in the new process first.

    Returns:
        its process id.
    """
    process = os.fork()
    if process == 0:
        _become(words, folder, streams, prepare)
    return process


def _become(words: Sequence[str], folder: Path, streams: tuple[int, int, int], prepare: Callable[[], None]) -> NoReturn:
    code = FAILED
    try:
        os.setsid()
        for ignored in (signal.SIGINT, signal.SIGHUP):  # in what a background shell or nohup starts
            signal.signal(ignored, signal.SIG_DFL if ignored == signal.SIGHUP else signal.default_int_handler)
        if os.isatty(streams[0]):
            os.close(os.open(os.ttyname(streams[0]), os.O_RDWR))  # the first that a leader opens becomes its own
        for number, descriptor in enumerate(streams):
            os.dup2(descriptor, number)
        os.closerange(3, 256)  # ends of pipes that belong to whoever reads along
        sys.stdin, sys.stdout, sys.stderr = open(0), open(1, "w"), open(2, "w", 1)  # noqa: SIM115
        os.chdir(folder)
        prepare()
        main(list(words))
    except SystemExit as ended:
        code = int(ended.code or 0)
    except BaseException:
        (folder / "traceback").write_text(traceback.format_exc())  # there may be nobody to print it to
        with suppress(OSError):
            traceback.print_exc()
    finally:
        for stream in (sys.stdout, sys.stderr):
            with suppress(OSError, ValueError):
                stream.flush()
        os._exit(code)


def side_by_side(
    works: Mapping[Key, Callable[[], tuple[str, ...]]], jobs: int
) -> Iterator[tuple[Key, tuple[str, ...]]]:
    """Do several pieces of work, each in a copy of this process; what they give, as it comes.

    Raises:
        AssertionError: one of them failed; it has said why.
    """
    waiting, running = deque(works.items()), dict[int, tuple[Key, Path]]()
    with tempfile.TemporaryDirectory() as folder:
        while waiting or running:
            while waiting and len(running) < jobs:
                key, work = waiting.popleft()
                file = Path(folder) / f"{len(waiting)}.json"
                process = os.fork()
                if process == 0:
                    _store(work, file)
                running[process] = (key, file)
            ended, _ = os.wait()
            key, file = running.pop(ended)
            assert file.is_file(), key
            yield key, tuple(json.loads(file.read_text()))


def _store(work: Callable[[], tuple[str, ...]], file: Path) -> NoReturn:
    try:
        file.write_text(json.dumps(work()))
    except BaseException:
        traceback.print_exc()
    finally:
        os._exit(0)
