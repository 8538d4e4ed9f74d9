"""Runs ``tactile-lab`` on its own terminal or with pipes, call after call, without importing it anew for each."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Self

import pexpect
from pexpect import fdpexpect

PROGRAM = Path(__file__).with_name("warm_program.py")
PATIENCE_s = 100
INTERRUPT = "\x03"
ENVIRONMENT = {
    **os.environ,
    "OPENBLAS_NUM_THREADS": "1",
    "NO_COLOR": "1",
    "COLUMNS": "200",
    "PYTHONPATH": str(Path(__file__).parents[2]),
}


class WarmProgram:
    """A context with the preloaded program; :meth:`terminal` and :meth:`pipes` call it. One call at a time."""

    def __enter__(self) -> Self:
        self._process = subprocess.Popen(
            [sys.executable, str(PROGRAM)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=ENVIRONMENT
        )
        self._call: Call | None = None
        return self

    def __exit__(self, *error: object) -> None:
        if self._call is not None:
            self._call.hang_up()  # a call left by a failed test waits for an answer that never comes
        self._process.communicate(timeout=PATIENCE_s)

    def terminal(self, folder: Path, *words: object) -> Terminal:
        """Call ``tactile-lab`` with some words, in a folder, on a new terminal."""
        ours, its = os.openpty()
        terminal = Terminal(self, self._begin([os.ttyname(its)] * 3, folder, words), ours)
        os.close(its)
        self._call = terminal
        return terminal

    def pipes(self, folder: Path, *words: object) -> Piped:
        """Call ``tactile-lab`` with some words, in a folder, with pipes, as another program would."""
        (out, its_out), (err, its_err) = os.pipe(), os.pipe()
        streams = ["/dev/null", *(f"/proc/{os.getpid()}/fd/{its}" for its in (its_out, its_err))]
        piped = Piped(self, self._begin(streams, folder, words), out, err)
        os.close(its_out)
        os.close(its_err)
        self._call = piped
        return piped

    def _begin(self, streams: Sequence[str], folder: Path, words: Sequence[object]) -> int:
        """Start a new call; returns its process id."""
        if self._call is not None and not self._call.gone:
            self._call.hang_up()  # left by a failed test, and nobody would ever answer
            self.answer()
        order = {"streams": list(streams), "folder": str(folder), "words": [str(word) for word in words]}
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps(order) + "\n")
        self._process.stdin.flush()
        return int(self.answer())

    def answer(self) -> str:
        """The next answer."""
        assert self._process.stdout is not None
        return self._process.stdout.readline().strip()


class Call:
    """One call of the program."""

    def __init__(self, program: WarmProgram, process_id: int) -> None:
        self._program, self._process_id = program, process_id
        self.gone = False
        """Whether the call has ended and its exit code was read."""

    def send_signal(self, number: signal.Signals) -> None:
        """Send a signal, as ``kill`` does."""
        os.kill(self._process_id, number)

    def exit_code(self) -> int:
        """Its exit code, after waiting for its end; minus the signal number if it was killed."""
        code = int(self._program.answer())
        self.gone = True
        return code

    def hang_up(self) -> None:
        """Disconnect from it, and make sure that it ends."""
        raise NotImplementedError


class Terminal(Call):
    """A call on a terminal, with the test in the role of the user."""

    def __init__(self, program: WarmProgram, process_id: int, descriptor: int) -> None:
        super().__init__(program, process_id)
        self._child = fdpexpect.fdspawn(descriptor, timeout=PATIENCE_s, encoding="utf-8")
        self.told = ""
        """Its output up to the last text that was waited for."""

    def until(self, text: str, then: str = "") -> None:
        """Wait for a text, then type something."""
        self._child.expect_exact(text)
        self.told += str(self._child.before) + text
        self.type(then)

    def type(self, text: str) -> None:
        """Type something now."""
        self._child.send(text)

    def hang_up(self) -> None:
        """Close the terminal, which ends what runs on it."""
        self._child.close()

    def ended(self, code: int) -> str:
        """Its whole output, once it has ended with this exit code. A traceback fails the test."""
        self._child.expect(pexpect.EOF)
        told = self.told + str(self._child.before)
        ended = self.exit_code()  # before closing the terminal, which would hang up a program that is still ending
        self._child.close()
        assert ended == code, told
        assert "Traceback" not in told, told
        return told


class Piped(Call):
    """A call with pipes, with the test in the role of the calling program."""

    def __init__(self, program: WarmProgram, process_id: int, out: int, err: int) -> None:
        super().__init__(program, process_id)
        self._out, self._err = os.fdopen(out), os.fdopen(err)
        self.told = ""
        """Its standard error up to the last line that was waited for."""
        self.answered = ""
        """Its standard output, once it has ended."""

    def until(self, pattern: str) -> None:
        """Wait for a line on standard error."""
        for line in self._err:
            self.told += line
            if re.search(pattern, line):
                return
        raise AssertionError(self.told)

    def hang_up(self) -> None:
        """Close the pipes and kill it."""
        self._out.close()
        self._err.close()
        if not self.gone:
            self.send_signal(signal.SIGKILL)

    def ended(self) -> int:
        """Its exit code, once it has ended and all output was read. A traceback fails the test."""
        self.told += self._err.read()
        self.answered, code = self._out.read(), self.exit_code()
        self.hang_up()
        assert "Traceback" not in self.told, self.told
        return code
