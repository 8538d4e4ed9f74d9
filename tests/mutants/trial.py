"""One mutation after the other, in a copy of the tree: do the tests tell it from the original?"""

from __future__ import annotations

import json
import os
import re
import select
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from tests.mutants.mutations import Mutation

# Loaded once, not in every run.
LIBRARIES = (
    "cv2", "gtsam", "h5py", "hypothesis", "mujoco", "numba", "pydantic", "rich.progress", "scipy.interpolate",
    "scipy.ndimage", "scipy.optimize", "scipy.spatial", "scipy.stats", "trimesh", "typer", "yaml",
)  # fmt: skip
# What does nothing for so many times its limit is ended.
_WAITING = 10
# A single test that takes longer without a mutation is not asked.
ALONE_s = 300.0
OUTCOME = re.compile(r"^(tests/\S+?(?:::.*?)?) (PASSED|FAILED|ERROR|SKIPPED|XFAIL)\b")
BROKEN_FILE = re.compile(r"^_+ ERROR collecting (tests/\S+)")
RUNNING = re.compile(r"^(tests/\S+\.py::.*?) *$")


@dataclass(frozen=True)
class Verdict:
    """What became of a mutation: killed, survived or timeout, by which test, and after what processor time."""

    mutation: Mutation
    outcome: str
    by: str
    seconds: float
    tests: int

    @property
    def dead(self) -> bool:
        """A mutation that never ends is noticed as well."""
        return self.outcome != "survived"


@dataclass(frozen=True)
class Run:
    """How tests ended: ``passed`` is None if the limit ended them, ``test`` the one that failed or ran then.

    ``seconds`` are of processor time; ``broken`` are tests that pytest could not even collect.
    """

    passed: bool | None
    test: str
    seconds: float
    broken: bool = False


class Copy:
    """A copy of the tree in which files are mutated; the tree itself stays as it is."""

    def __init__(
        self, root: Path, folder: Path, patience_s: float = 30.0, libraries: Sequence[str] = LIBRARIES
    ) -> None:
        self.folder, self.scratch, self.patience_s = folder / "tree", folder / "scratch", patience_s
        listed = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
        for name in subprocess.run(listed, cwd=root, check=True, capture_output=True, text=True).stdout.split("\0"):
            if name and (root / name).is_file():
                (self.folder / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(root / name, self.folder / name)
        self.scratch.mkdir()
        self.machine_code = self.scratch / "machine-code"
        self._pytest = WarmPytest(self.folder, libraries, {"NUMBA_CACHE_DIR": str(self.machine_code)})
        self.spent_s = 0.0
        self.distrusted: set[str] = set()
        self.passing: dict[str, float | None] = {}
        self._next_second = int(time.time()) + 1000

    def close(self) -> None:
        """End the process that runs its tests."""
        self._pytest.close()

    def verdict(self, mutation: Mutation, tests: list[str], limit_s: float) -> Verdict:
        """Run tests on a mutation until one fails that passes without it, or for as long as the limit allows."""
        original = (self.folder / mutation.path).read_text(encoding="utf-8")
        mutated = mutation.applied(original)
        start_s = self.spent_s
        outcome, by = "survived", ""
        # The nearest file alone at first: most mutations end there, and importing the others takes longer.
        near = [test for test in tests if _file(test) == _file(tests[0])]
        for group in filter(None, (near, [test for test in tests if test not in near])):
            left_s = start_s + limit_s - self.spent_s
            if outcome == "survived" and left_s > 0:
                outcome, by = self._outcome(mutation.path, original, mutated, group, left_s)
        return Verdict(mutation, outcome, by, self.spent_s - start_s, len(tests))

    def _outcome(self, path: str, original: str, mutated: str, tests: list[str], limit_s: float) -> tuple[str, str]:
        """What became of a mutation, and by which test."""
        run = self._run_on(path, mutated, tests, limit_s)
        if run.passed:
            return "survived", ""
        usual_s = self._usual_s(path, original, run.test)
        if usual_s is None:  # it fails without any mutation: ask the others
            self.distrusted.add(run.test)
            return self._outcome(path, original, mutated, tests, limit_s)
        if run.passed is None:
            alone = self._run_on(path, mutated, [run.test], 3 * usual_s + self.patience_s)
            return ("timeout", run.test) if alone.passed is None else ("survived", "")
        return "killed", run.test

    def _usual_s(self, path: str, original: str, test: str) -> float | None:
        """How long a test takes without a mutation; None if it does not pass."""
        if test not in self.passing:
            alone = self._run_on(path, original, [test], ALONE_s)
            if alone.broken:
                raise RuntimeError(f"pytest cannot run {test}:\n{(self.scratch / 'output').read_text()}")
            self.passing[test] = alone.seconds if alone.passed else None
        return self.passing[test]

    def _run_on(self, path: str, source: str, tests: list[str], limit_s: float) -> Run:
        """Run with one file as given. Its time of change is new each time: bytecode of another version never serves."""
        file = self.folder / path
        original = file.read_bytes(), file.stat().st_mtime
        self._next_second += 10
        try:
            file.write_text(source, encoding="utf-8")
            os.utime(file, (self._next_second, self._next_second))
            return self._run(tests, limit_s, fresh_machine_code="compiled" in source)
        finally:
            file.write_bytes(original[0])
            os.utime(file, (original[1], original[1]))

    def _run(self, tests: list[str], limit_s: float, fresh_machine_code: bool) -> Run:
        output = self.scratch / "output"
        words = ["-x", "-v", "-o", "addopts=", "-p", "no:cacheprovider", f"--basetemp={self.scratch / 'pytest'}"]
        words += ["-W", "ignore::pytest.PytestAssertRewriteWarning"]  # a plugin's library is loaded already
        words += [*(f"--deselect={test}" for test in self.distrusted), *tests]
        # Machine code is kept by the file it was made from, and does not know those it calls.
        if fresh_machine_code:
            shutil.rmtree(self.machine_code, ignore_errors=True)
        code, seconds = self._pytest.run(words, output, limit_s)
        self.spent_s += seconds
        lines = output.read_text(encoding="utf-8", errors="replace").splitlines()
        test = _failed(lines) if code is not None else _running(lines)
        passed = None if code is None else code in (0, 5)
        return Run(passed, test or tests[0], seconds, code not in (None, 0, 1, 5))


class WarmPytest:
    """The process that runs pytest in copies of itself, in a folder."""

    def __init__(self, folder: Path, libraries: Sequence[str], environment: dict[str, str]) -> None:
        program = Path(__file__).with_name("warm_pytest.py")
        self._process = subprocess.Popen(
            [sys.executable, str(program), *libraries],
            cwd=folder,
            env=os.environ | environment | {"PYTHONPATH": str(folder)},
            bufsize=0,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )

    def close(self) -> None:
        """End it."""
        self._process.communicate()

    def run(self, words: list[str], output: Path, limit_s: float) -> tuple[int | None, float]:
        """One run: its exit code, None if the limit ended it, and the seconds of processor time it took.

        The limit is of processor time, so that a busy machine changes no verdict; what waits for ever is ended after
        ten times as long. Ctrl+C comes first, so that a run ends its children.
        """
        assert self._process.stdin is not None
        order = {"words": words, "output": str(output)}
        self._process.stdin.write(json.dumps(order).encode() + b"\n")
        self._process.stdin.flush()
        child = int(self._answer(None) or 0)
        give_up = time.monotonic() + _WAITING * limit_s
        while (answer := self._answer(0.2)) is None and time.monotonic() < give_up and _spent_s(child) < limit_s:
            pass
        if answer is not None:
            code, seconds = answer.split()
            return int(code), float(seconds)
        os.killpg(child, signal.SIGINT)
        answer = self._answer(10.0)
        if answer is None:
            os.killpg(child, signal.SIGKILL)
            answer = self._answer(None)
        return None, float((answer or b"0 0").split()[1])

    def _answer(self, limit_s: float | None) -> bytes | None:
        assert self._process.stdout is not None
        if not select.select([self._process.stdout], [], [], limit_s)[0]:
            return None
        return self._process.stdout.readline()


def _spent_s(process: int) -> float:
    """Processor time of a process and of its children that have ended."""
    try:
        figures = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0  # it has just ended
    return sum(map(int, figures[11:15])) / os.sysconf("SC_CLK_TCK")


def _file(test: str) -> str:
    return test.partition("::")[0]


def _failed(lines: list[str]) -> str:
    outcomes = [match for match in map(OUTCOME.match, lines) if match and match[2] in ("FAILED", "ERROR")]
    broken = [match for match in map(BROKEN_FILE.match, lines) if match]
    return next((match[1] for match in outcomes + broken), "")


def _running(lines: list[str]) -> str:
    started = [match[1] for match in map(RUNNING.match, lines) if match and not OUTCOME.match(match[0])]
    return started[-1] if started else ""
