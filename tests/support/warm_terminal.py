"""``tactile-lab`` on terminals of its own, one after the other, without loading it anew for each."""

from __future__ import annotations

import json
import os
import subprocess
import sys
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
    """A context with the loaded program; :meth:`terminal` calls it."""

    def __enter__(self) -> Self:
        self._process = subprocess.Popen(
            [sys.executable, str(PROGRAM)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=ENVIRONMENT
        )
        self._terminal: Terminal | None = None
        return self

    def __exit__(self, *error: object) -> None:
        if self._terminal is not None:
            self._terminal.hang_up()  # what a failed test has left waits for an answer that never comes
        self._process.communicate(timeout=PATIENCE_s)

    def terminal(self, folder: Path, *words: object) -> Terminal:
        """``tactile-lab`` with some words, in a folder, on a new terminal. One at a time."""
        if self._terminal is not None and not self._terminal.gone:
            self._terminal.hang_up()  # a failed test has left it, and nobody would ever answer
            self.answer()
        ours, its = os.openpty()
        order = {"terminal": os.ttyname(its), "folder": str(folder), "words": [str(word) for word in words]}
        self.tell(json.dumps(order))
        assert self.answer() == "ready"
        os.close(its)
        self._terminal = Terminal(self, ours)
        return self._terminal

    def tell(self, line: str) -> None:
        """One order."""
        assert self._process.stdin is not None
        self._process.stdin.write(line + "\n")
        self._process.stdin.flush()

    def answer(self) -> str:
        """The next answer."""
        assert self._process.stdout is not None
        return self._process.stdout.readline().strip()


class Terminal:
    """One call of the program, as the person before it."""

    def __init__(self, program: WarmProgram, descriptor: int) -> None:
        self._program = program
        self._child = fdpexpect.fdspawn(descriptor, timeout=PATIENCE_s, encoding="utf-8")
        self.told = ""
        """What it has said, up to the last text that was waited for."""
        self.gone = False
        """Whether the call has ended and its exit code was taken."""

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
        self._child.close()
        told = self.told + str(self._child.before)
        self.gone = True
        assert self._program.answer() == str(code), told
        assert "Traceback" not in told, told
        return told
