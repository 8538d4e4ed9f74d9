"""Ctrl+C at the instants at which Python, the system or a library would lose it."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from sessions.conductor.policy_decisions import Proposal
from sessions.motion.grasp_frame import GraspFrame
from sessions.motion.grasp_plan import GraspPlan
from tactile_lab.cli.calibrate import wizard
from tactile_lab.cli.interruptions import interruptions_heeded
from tactile_lab.cli.main import main
from tactile_lab.cli.running import approval
from tactile_lab.cli.running.approval import TerminalApproval
from tactile_lab.cli.running.progress import INTERRUPTED, LiveProgress
from tactile_lab.cli.terminal_input import LineInput

PATIENCE_s = 30.0
SWALLOWS = """
import signal
import subprocess
try:
    signal.raise_signal(signal.SIGINT)
except BaseException:
    swallowed = True
"""


@pytest.fixture
def heeded() -> Iterator[None]:
    """The program's own way with signals."""
    with interruptions_heeded():
        yield
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


@pytest.fixture
def typed(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """Where to write what a person types."""
    reading, writing = os.pipe()
    for module in (approval, wizard):
        monkeypatch.setattr(module, "LineInput", lambda: LineInput(reading))
    yield writing
    os.close(reading)
    os.close(writing)


def wait() -> None:
    """What comes late comes in here."""
    give_up = time.monotonic() + PATIENCE_s
    while time.monotonic() < give_up:
        time.sleep(0.01)


def library(folder: Path) -> None:
    """An import that takes any exception for a library that is not there."""
    (folder / "swallowing.py").write_text(SWALLOWS)
    import swallowing  # type: ignore[import-not-found]

    assert not hasattr(swallowing, "swallowed")


def attempt(folder: Path) -> None:
    """Work of trimesh, which tries things and goes on without them."""
    names: dict[str, object] = {"__name__": "trimesh.exchange.load"}
    exec(SWALLOWS, names)
    assert "swallowed" not in names


def finaliser(folder: Path) -> None:
    """Python prints and forgets what is raised in one."""

    class Dying:
        def __del__(self) -> None:
            signal.raise_signal(signal.SIGINT)

    Dying()


@pytest.mark.parametrize("place", [library, attempt, finaliser], ids=lambda place: place.__name__)
@pytest.mark.usefixtures("heeded")
def test_ctrl_c_comes_again_where_it_would_be_forgotten(
    place: Callable[[Path], None], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(KeyboardInterrupt):  # noqa: PT012 - it comes after, not in
        place(tmp_path)
        wait()
    sys.modules.pop("swallowing", None)


def test_other_exceptions_of_finalisers_are_told_as_ever(monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[object] = []
    monkeypatch.setattr(sys, "unraisablehook", lambda dropped: told.append(dropped.exc_value))

    class Failing:
        def __del__(self) -> None:
            raise ValueError("a bug")

    with interruptions_heeded():
        Failing()
    assert [str(error) for error in told] == ["a bug"]


@contextmanager
def unheard(typed: int) -> Iterator[None]:
    """A signal that ends no wait of the main thread, as one that comes just before it; Enter in the end."""
    over = threading.Event()

    def send() -> None:
        time.sleep(0.2)
        signal.pthread_kill(threading.get_ident(), signal.SIGINT)
        if not over.wait(PATIENCE_s):
            os.write(typed, b"\n")

    sender = threading.Thread(target=send)
    sender.start()
    try:
        yield
    finally:
        over.set()
        sender.join()


@pytest.mark.usefixtures("heeded")
def test_ctrl_c_just_before_the_wait_ends_the_question(typed: int) -> None:
    with pytest.raises(KeyboardInterrupt), unheard(typed):
        wizard.Asker(False, "test").choose("Is its path clear?", {"y": "yes"}, "y")


def proposal(withdrawn: Callable[[], bool] = lambda: False) -> Proposal:
    return Proposal(1, GraspPlan(GraspFrame(0.0, 0.0, 0.0), "pinch", 0.02), withdrawn=withdrawn)


def test_a_grasp_is_approved_vetoed_or_neither_when_the_session_is_to_end(typed: int) -> None:
    approve = TerminalApproval()
    os.write(typed, b"\nN\n")
    assert (approve(proposal()), approve(proposal())) == (True, False)
    looks: list[int] = []
    assert approve(proposal(lambda: len(looks) > 2 or bool(looks.append(1))))
    os.write(typed, b"no\n")
    assert not approve(proposal())  # it asks again


def test_ctrl_c_in_a_session_shows_at_once_and_stays_on_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    with LiveProgress("a session", live=False) as progress:
        progress.phase(1, "descend")
        progress.on_interrupt()
        assert progress._render().plain == INTERRUPTED
        progress.phase(1, "close")
        assert progress._render().plain == "grasp 1: close"
        progress.phase(1, "capture")
    assert capsys.readouterr().err.count(INTERRUPTED) == 1


def test_an_unfinished_line_counts_when_the_input_ends() -> None:
    reading, writing = os.pipe()
    lines = LineInput(reading)
    os.write(writing, b"y\nno")
    os.close(writing)
    assert [*lines.lines(), *lines.lines(), *lines.lines()] == ["y", "no"]
    os.close(reading)


def test_a_terminal_that_goes_ends_the_program_in_order_and_only_once() -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)  # the tests themselves may run behind nohup
    try:
        with interruptions_heeded():
            with pytest.raises(KeyboardInterrupt):
                signal.raise_signal(signal.SIGHUP)
            signal.raise_signal(signal.SIGHUP)  # the shell's, behind the system's
        assert signal.getsignal(signal.SIGHUP) is signal.SIG_DFL
    finally:
        signal.signal(signal.SIGHUP, before)


def test_a_hangup_that_is_ignored_stays_ignored() -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with interruptions_heeded():
            signal.raise_signal(signal.SIGHUP)
    finally:
        signal.signal(signal.SIGHUP, before)


@pytest.mark.parametrize(
    "error", [MemoryError(), RuntimeError("Could not allocate memory"), ImportError("x.so: failed to map segment")]
)
def test_exhausted_memory_is_told_in_words(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], error: Exception
) -> None:
    def exhausted(*arguments: object, **named: object) -> None:
        raise error

    monkeypatch.setattr("tactile_lab.cli.app.app", exhausted)
    with pytest.raises(SystemExit) as ended:
        main(["rig", "list"])
    assert ended.value.code == 1
    assert "the memory is exhausted" in capsys.readouterr().err


def test_a_limit_of_memory_that_libraries_do_not_survive_is_told_before_they_are_loaded() -> None:
    """With some limits OpenBLAS asks for memory for ever, which nothing but a kill ends."""
    words = [
        "-c",
        "import resource as r, tactile_lab.cli.main as m; r.setrlimit(r.RLIMIT_AS, (240 << 20,) * 2); m.main()",
    ]
    ended = subprocess.run(
        [sys.executable, *words], capture_output=True, text=True, timeout=10 * PATIENCE_s, check=False
    )
    assert ended.returncode == 2
    assert ended.stderr.splitlines() == [
        "error: tactile-lab: only 252 MB of memory are allowed (ulimit -v), at least 1000 are needed. Raise the limit"
    ]


def test_a_file_that_the_system_refuses_is_told_in_words(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def refused(*arguments: object, **named: object) -> None:
        raise PermissionError(errno.EACCES, "words of a library", "/there/it.yaml")

    monkeypatch.setattr("tactile_lab.cli.app.app", refused)
    with pytest.raises(SystemExit) as ended:
        main(["rig", "list"])
    assert ended.value.code == 1
    assert "error: /there/it.yaml: cannot be used (Permission denied)." in capsys.readouterr().err
