"""``tactile-lab`` on a terminal of its own or behind pipes, call after call, without loading it anew for each."""

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
    """A context with the loaded program; :meth:`terminal` and :meth:`pipes` call it. One call at a time."""

    def __enter__(self) -> Self:
        self._process = subprocess.Popen(
            [sys.executable, str(PROGRAM)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=ENVIRONMENT
        )
        self._call: Call | None = None
        return self

    def __exit__(self, *error: object) -> None:
        if self._call is not None:
            self._call.hang_up()  # what a failed test has left waits for an answer that never comes
        self._process.communicate(timeout=PATIENCE_s)

    def terminal(self, folder: Path, *words: object) -> Terminal:
        """``tactile-lab`` with some words, in a folder, on a new terminal."""
        ours, its = os.openpty()
        terminal = Terminal(self, self._begin([os.ttyname(its)] * 3, folder, words), ours)
        os.close(its)
        self._call = terminal
        return terminal

    def pipes(self, folder: Path, *words: object) -> Piped:
        """``tactile-lab`` with some words, in a folder, as another program would call it."""
        (out, its_out), (err, its_err) = os.pipe(), os.pipe()
        streams = ["/dev/null", *(f"/proc/{os.getpid()}/fd/{its}" for its in (its_out, its_err))]
        piped = Piped(self, self._begin(streams, folder, words), out, err)
        os.close(its_out)
        os.close(its_err)
        self._call = piped
        return piped

    def _begin(self, streams: Sequence[str], folder: Path, words: Sequence[object]) -> int:
        """A new call; gives its process id."""
        if self._call is not None and not self._call.gone:
            self._call.hang_up()  # a failed test has left it, and nobody would ever answer
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
        """Whether the call has ended and its exit code was taken."""

    def send_signal(self, number: signal.Signals) -> None:
        """As ``kill`` does."""
        os.kill(self._process_id, number)

    def exit_code(self) -> int:
        """How it ended, as soon as it has; minus the signal that has killed it."""
        code = int(self._program.answer())
        self.gone = True
        return code

    def hang_up(self) -> None:
        """Leave it, and see that it ends."""
        raise NotImplementedError


class Terminal(Call):
    """A call on a terminal, as the person before it."""

    def __init__(self, program: WarmProgram, process_id: int, descriptor: int) -> None:
        super().__init__(program, process_id)
        self._child = fdpexpect.fdspawn(descriptor, timeout=PATIENCE_s, encoding="utf-8")
        self.told = ""
        """What it has said, up to the last text that was waited for."""

    def until(self, text: str, then: str = "") -> None:
        """Wait for a text, then type something."""
        self._child.expect_exact(text)
        self.told += str(self._child.before) + text
        self.type(then)

    def type(self, text: str) -> None:
        """Type something now."""
        self._child.send(text)

    def hang_up(self) -> None:
        """The terminal goes, and with it what runs on it."""
        self._child.close()

    def ended(self, code: int) -> str:
        """Everything it said, once it ended with that exit code. A traceback fails the test."""
        self._child.expect(pexpect.EOF)
        told = self.told + str(self._child.before)
        ended = self.exit_code()  # before the terminal goes: a program that is still ending would be hung up
        self._child.close()
        assert ended == code, told
        assert "Traceback" not in told, told
        return told


class Piped(Call):
    """A call behind pipes, as the program that has made it."""

    def __init__(self, program: WarmProgram, process_id: int, out: int, err: int) -> None:
        super().__init__(program, process_id)
        self._out, self._err = os.fdopen(out), os.fdopen(err)
        self.told = ""
        """What it has said on standard error, up to the last line that was waited for."""
        self.answered = ""
        """What it has said on standard output, once it ended."""

    def until(self, pattern: str) -> None:
        """Wait for a line on standard error."""
        for line in self._err:
            self.told += line
            if re.search(pattern, line):
                return
        raise AssertionError(self.told)

    def hang_up(self) -> None:
        """Nobody reads on, and it is killed."""
        self._out.close()
        self._err.close()
        if not self.gone:
            self.send_signal(signal.SIGKILL)

    def ended(self) -> int:
        """Exit code, once it ended and all was read. A traceback fails the test."""
        self.told += self._err.read()
        self.answered, code = self._out.read(), self.exit_code()
        self.hang_up()
        assert "Traceback" not in self.told, self.told
        return code
