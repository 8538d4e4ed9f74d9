"""The command line as people run it: a process of its own, and one short session that many tests look at."""

from __future__ import annotations

import fcntl
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from io import StringIO
from pathlib import Path

import pytest

from tactile_lab.cli.main import main
from tests.support.low_rig import low_rig
from tests.support.warm_terminal import WarmProgram

COMMAND = [sys.executable, "-m", "tactile_lab.cli.main"]
ENVIRONMENT = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "COLUMNS": "80", "NO_COLOR": "1"}


@dataclass(frozen=True)
class Answer:
    """What a command answered: exit code, standard output, standard error."""

    code: int
    out: str
    err: str


Command = Callable[..., Answer]


def call(*arguments: object, cwd: Path | None = None) -> Answer:
    """Run ``tactile-lab`` in a process of its own. No answer may hold a traceback."""
    words = [*COMMAND, *map(str, arguments)]
    done = subprocess.run(words, capture_output=True, text=True, env=ENVIRONMENT, cwd=cwd, timeout=300, check=False)
    assert "Traceback" not in done.stderr, done.stderr
    return Answer(done.returncode, done.stdout, done.stderr)


@pytest.fixture(scope="session")
def tactile_lab() -> Command:
    """The command line."""
    return call


@pytest.fixture(scope="session")
def program() -> Iterator[WarmProgram]:
    """The command line on terminals of its own."""
    with WarmProgram() as running:
        yield running


@pytest.fixture
def inside() -> Iterator[Command]:
    """The command line within the test's own process, which spares loading everything again."""
    handler = signal.getsignal(signal.SIGTERM)
    yield call_inside
    signal.signal(signal.SIGTERM, handler)


def call_inside(*arguments: object) -> Answer:
    """Run ``tactile-lab`` here. An error that is not meant for people fails the test by itself."""
    with redirect_stdout(StringIO()) as out, redirect_stderr(StringIO()) as err, pytest.raises(SystemExit) as ended:
        main([str(argument) for argument in arguments])
    return Answer(int(ended.value.code or 0), out.getvalue(), err.getvalue())


@pytest.fixture(scope="session")
def recorded_root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with one finished session of two grasps, the same for all workers of a run; only to be read."""
    shared = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        shared = shared.parent
    folder = shared / "recorded"
    with (shared / "recorded.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not (folder / "run.json").is_file():
            record(folder)
    return folder / "runs"


def record(folder: Path) -> None:
    """Run the session; what it said on standard error and, last of all, on standard output, is kept beside it."""
    folder.mkdir(exist_ok=True)
    words = ("--rig", low_rig(folder), "--grasps", 2, "--seed", 1, "--notes", "for the tests")
    answer = call("run", *words, "--out", folder / "runs", "--json")
    assert answer.code == 0, answer.err
    (folder / "run.err").write_text(answer.err)
    (folder / "run.json").write_text(answer.out)


@pytest.fixture(scope="session")
def recorded(recorded_root: Path) -> Path:
    """The folder of that session; only to be read."""
    (folder,) = recorded_root.iterdir()
    return folder


@pytest.fixture
def session_copy(recorded: Path, tmp_path: Path) -> Path:
    """A session that a test may spoil."""
    return Path(shutil.copytree(recorded, tmp_path / "session"))
