"""Runs a module in a child process: start it, send commands, read its answers, end it.

Two pipes lead to the child: commands are lines of JSON (see :mod:`drivers.core.orders`), the first of them configures
it. Its output can have any form; :meth:`ChildProcess.answer` reads lines of JSON, :func:`say` is the child's side of
that. The command pipe closes when the parent ends, however that happens, and the child must then end: it checks that
pipe regularly.
"""

from __future__ import annotations

import json
import os
import runpy
import select
import subprocess
import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from drivers.core.clock import NANOSECONDS, MonotonicClock
from drivers.core.errors import DeviceError, TactileLabError
from drivers.core.orders import Order, OrderWriter

_READ_BYTES = 1_048_576
_ENDING_s = 1.0
_PACKAGES = Path(__file__).resolve().parents[2]
_INSTALLED = ("site-packages", "dist-packages")
"""Folders that Python searches by default, besides its standard library."""

_SHOWN = 80


def child_command(module: str, *words: str) -> list[str]:
    """The command that runs a module of ours as a program, without the current folder on its import path.

    Python puts that folder first for ``-m``, and would execute a ``drivers.py`` or ``numpy.py`` that lies there.
    """
    return [sys.executable, "-P", "-m", "drivers.core.child_process", module, *words]


def child_environment() -> dict[str, str]:
    """The environment for such a command: this one, with our packages where this process has them from.

    Of the entries of ``PYTHONPATH``, made absolute, those that mean the current folder, as an empty one does, are left
    out. So it is the same whether the packages are installed, installed as a checkout, or found by ``PYTHONPATH``.
    """
    entries = [Path(entry).resolve() for entry in os.environ.get("PYTHONPATH", "").split(os.pathsep) if entry]
    ours = [] if _PACKAGES.name in _INSTALLED else [_PACKAGES]
    kept = dict.fromkeys(map(str, [*ours, *(entry for entry in entries if entry != Path.cwd())]))
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    return environment | ({"PYTHONPATH": os.pathsep.join(kept)} if kept else {})


class ChildProcess:
    """A child and its two pipes; nothing runs before :meth:`start`. Not thread-safe.

    Args:
        module: run as a program.
        name: of the device or work, for messages.
    """

    def __init__(self, module: str, name: str) -> None:
        self.name, self._module = name, module
        self._process: subprocess.Popen[bytes] | None = None
        self._orders: OrderWriter | None = None
        self._rest = b""

    def start(self, first: Order) -> None:
        """Start it with its first command, without waiting until it is ready.

        It has a separate process group: Ctrl+C goes to the parent, which ends it properly.

        Raises:
            DeviceError: it ended immediately.
        """
        assert self._process is None, f"{self.name} has been started already"
        self._process = subprocess.Popen(
            child_command(self._module),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            process_group=0,
            env=child_environment(),
        )
        assert self._process.stdin is not None
        self._orders, self._rest = OrderWriter(self._process.stdin.fileno(), self.name), b""
        try:
            self.give(first)
        except DeviceError:
            self.close(0.0)
            raise

    @property
    def started(self) -> bool:
        """Whether it was started and not yet closed; it may have ended by itself."""
        return self._process is not None

    @property
    def running(self) -> bool:
        """Whether its process is running."""
        return self._process is not None and self._process.poll() is None

    @property
    def process_id(self) -> int:
        """Process id of the started process. Raises DeviceError if there is none."""
        return self._start().pid

    def give(self, order: Order) -> None:
        """Send a command, without waiting.

        Raises:
            DeviceError: it is not started, has ended, or has not read commands for long.
        """
        self._start()
        assert self._orders is not None
        self._orders.give(order)

    def read(self, patience_s: float) -> bytes | None:
        """Bytes that arrive in this time; None if there are none.

        Raises:
            DeviceError: it is not started, or has ended and all output was read.
        """
        process = self._start()
        assert process.stdout is not None
        if not select.select([process.stdout], [], [], max(patience_s, 0.0))[0]:
            return None
        if not (data := os.read(process.stdout.fileno(), _READ_BYTES)):
            with suppress(subprocess.TimeoutExpired):  # it says nothing more a moment before it has ended
                process.wait(_ENDING_s)
            raise DeviceError("its process has ended", where=self.name, hint="Check its last error, and connect again")
        return data

    def ready(self, patience_s: float) -> dict[str, Any]:
        """Its first answer; without a valid one it is closed.

        Raises:
            DeviceError: as :meth:`answer`.
        """
        try:
            return self.answer(patience_s)
        except BaseException:
            self.close()
            raise

    def answer(self, patience_s: float) -> dict[str, Any]:
        """Wait for its next line of JSON.

        Raises:
            DeviceError: none arrives in this time; and as :meth:`hear`.
        """
        if (content := self.hear(patience_s)) is None:
            raise DeviceError("its process does not answer", where=self.name, hint="Start it again")
        return content

    def hear(self, patience_s: float = 0.0) -> dict[str, Any] | None:
        """Its next line of JSON; None if none arrives in this time.

        Raises:
            DeviceError: it has ended, the line is an error of :func:`errors_said`, or not an answer.
        """
        clock = MonotonicClock()
        until_ns = clock.now_ns() + round(patience_s * NANOSECONDS)
        while b"\n" not in self._rest:
            if (data := self.read((until_ns - clock.now_ns()) / NANOSECONDS)) is None:
                return None
            self._rest += data
        line, self._rest = self._rest.split(b"\n", 1)
        content = read_answer(line, self.name)
        if "error" in content:
            raise DeviceError(content["error"], where=self.name)
        return content

    def kill(self) -> None:
        """Kill it immediately; idempotent."""
        if self._process is not None:
            self._process.kill()
        self.close(0.0)

    def close(self, patience_s: float = 5.0) -> bytes:
        """Close its command pipe and wait until it has ended, or kill it after a timeout; idempotent.

        Returns:
            output that was not read.
        """
        if self._process is None:
            return b""
        process, self._process = self._process, None
        try:
            said, _ = process.communicate(timeout=patience_s)
        except subprocess.TimeoutExpired:
            process.kill()
            said, _ = process.communicate()
        return self._rest + (said or b"")

    def _start(self) -> subprocess.Popen[bytes]:
        if self._process is None:
            raise DeviceError("not connected", where=self.name, hint="Connect it first")
        return self._process


def read_answer(line: bytes, where: str) -> dict[str, Any]:
    """Parse a child's line of JSON.

    Raises:
        DeviceError: it is something else; a library of the child's may have printed it.
    """
    with suppress(ValueError):
        if isinstance(content := json.loads(line), dict):
            return content
    shown = line[:_SHOWN].decode(errors="replace")
    raise DeviceError(f"unexpected output of its process: {shown!r}", where=where, hint="Start it again")


# --- the child's side ----------------------------------------------------------------------------------------------


def say(content: dict[str, Any]) -> None:
    """Write a line, for :meth:`ChildProcess.answer`."""
    sys.stdout.write(json.dumps(content) + "\n")
    sys.stdout.flush()


@contextmanager
def errors_said() -> Iterator[None]:
    """Errors are written as an answer and end the process: those of this program with their exit code."""
    try:
        yield
    except TactileLabError as error:
        say({"error": str(error)})
        sys.exit(error.exit_code)
    except Exception as error:
        say({"error": failure(error)})
        sys.exit(1)


def failure(error: Exception) -> str:
    """An unexpected error in one line: what it was, and where it happened."""
    frames = traceback.extract_tb(error.__traceback__)
    place = f", in {frames[-1].filename}, line {frames[-1].lineno}" if frames else ""
    words = " ".join(str(error).split())
    return f"the program itself failed ({type(error).__name__}: {words}{place}). Please report this line"


def main() -> None:
    """The entry point of every child: run the module in the first argument; errors are one line."""
    module, sys.argv[1:] = sys.argv[1], sys.argv[2:]
    try:
        runpy.run_module(module, run_name="__main__", alter_sys=True)
    except Exception as error:
        sys.exit(f"{module}: {failure(error)}")
    except KeyboardInterrupt:
        sys.exit(130)


if __name__ == "__main__":
    main()
