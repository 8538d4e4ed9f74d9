"""pytest kept warm: a process that has loaded the libraries it is told to, and a copy of it for each run.

Loading numpy, scipy and the like takes longer than most tests. Takes lines of JSON, ``{output, words}``. Answers the
copy's process id once it runs, and in the end its exit code and its seconds of processor time. Nothing of the packages
under test is loaded beforehand: each copy loads what stands there then.
"""

from __future__ import annotations

import importlib
import json
import os
import resource
import signal
import sys
from typing import Any

import pytest

# A mutated loop may fill the memory: 8 GiB of addresses are more than any test needs.
MEMORY_bytes = 8 << 30


def serve() -> None:
    """Run after run, until the orders end."""
    orders = os.fdopen(os.dup(0), encoding="utf-8")
    for line in orders:
        child = os.fork()
        if child == 0:
            become(json.loads(line))
        print(child, flush=True)
        _, status, used = os.wait4(child, 0)
        print(os.waitstatus_to_exitcode(status), used.ru_utime + used.ru_stime, flush=True)


def become(order: dict[str, Any]) -> None:
    """One run, as the leader of a session. Never returns."""
    os.setsid()
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_bytes, MEMORY_bytes))
    nothing, output = os.open(os.devnull, os.O_RDONLY), os.open(order["output"], os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    for descriptor, stream in enumerate((nothing, output, output)):
        os.dup2(stream, descriptor)
    sys.stdin, sys.stdout, sys.stderr = open(0), open(1, "w"), open(2, "w", 1)  # noqa: SIM115
    signal.signal(signal.SIGINT, signal.default_int_handler)
    code = pytest.main(order["words"])
    sys.stdout.flush()
    os._exit(code)


if __name__ == "__main__":
    sys.path.remove(os.path.dirname(os.path.abspath(__file__)))  # noqa: PTH100, PTH120
    for library in sys.argv[1:]:
        importlib.import_module(library)
    serve()
