"""A module in a process of its own: started, ordered, heard, ended."""

from __future__ import annotations

import os
import re
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

from drivers.core.child_process import ChildProcess, child_environment
from drivers.core.errors import DeviceError

CHILD = """
import os, sys, time
from drivers.core.child_process import errors_said, say
from drivers.core.orders import OrderReader
from drivers.core.errors import DeviceError

orders = OrderReader(sys.stdin.fileno())
with errors_said():
    first = orders.first()
    if "fail" in first:
        raise DeviceError(first["fail"])
    say({"ready": True, "group": os.getpgid(0)})
    ended = False
    while not ended:
        for order in orders.waiting(1.0):
            if "sleep_s" in order:
                time.sleep(order["sleep_s"])
            if "echo" in order:
                for word in order["echo"]:
                    say({"word": word})
            if "end" in order:
                ended = True
    say({"last": "words"})
"""
PATIENCE_s = 60.0


@pytest.fixture
def child(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[ChildProcess]:
    child = child_of(CHILD, tmp_path, monkeypatch)
    yield child
    child.kill()


def test_a_child_answers_in_order_and_its_last_words_come_with_its_end(child: ChildProcess) -> None:
    child.start({"go": True})
    ready = child.ready(PATIENCE_s)
    assert child.started
    assert child.running
    assert ready == {"ready": True, "group": child.process_id}, "Ctrl+C goes to the session's group alone"
    child.give({"echo": ["a", "b", "c"]})
    assert [child.answer(PATIENCE_s)["word"] for _ in range(3)] == ["a", "b", "c"]
    assert child.hear() is None, "nothing more was said"
    assert child.close(PATIENCE_s) == b'{"last": "words"}\n'
    assert child.close() == b""
    assert not child.started


def test_a_child_that_fails_says_why_and_is_closed(child: ChildProcess) -> None:
    child.start({"fail": "no such thing"})
    with pytest.raises(DeviceError, match="echo: no such thing"):
        child.ready(PATIENCE_s)
    assert not child.started


def test_a_child_that_was_killed_is_told_and_can_be_started_again(child: ChildProcess) -> None:
    child.start({"go": True})
    child.ready(PATIENCE_s)
    os.kill(child.process_id, signal.SIGKILL)
    with pytest.raises(DeviceError, match="echo: its process has ended"):
        child.answer(PATIENCE_s)
    assert not child.running
    with pytest.raises(DeviceError, match="echo: its process has ended"):
        child.give({"echo": ["x"]})
    child.kill()
    child.start({"go": True})
    assert child.ready(PATIENCE_s)["ready"]


def test_a_busy_child_does_not_hold_up_orders_and_is_killed_when_it_does_not_end(child: ChildProcess) -> None:
    child.start({"go": True})
    child.ready(PATIENCE_s)
    child.give({"sleep_s": 600.0})
    with pytest.raises(DeviceError, match="echo: its process does not answer"):
        child.answer(0.0)
    with pytest.raises(DeviceError, match="echo: its process accepts no commands"):
        child.give({"echo": ["x" * 100_000]})
    assert child.close(0.0) == b""


def test_what_is_not_started_says_so(child: ChildProcess) -> None:
    with pytest.raises(DeviceError, match="echo: not connected"):
        child.give({})
    with pytest.raises(DeviceError, match="echo: not connected"):
        child.read(0.0)


# --- what a child imports -------------------------------------------------------------------------------------------

PACKAGES = Path(__file__).resolve().parents[4]
OURS = ("drivers", "sessions", "calibration", "tactile_lab")
THEIRS = ("numpy", "scipy", "gtsam", "cv2", "pydantic", "yaml", "threadpoolctl", "json", "runpy", "selectors", "typing")
IMPORTING = f"""
import importlib
from drivers.core.child_process import errors_said, say
with errors_said():
    say({{name: importlib.import_module(name).__name__ for name in {OURS + THEIRS!r}}})
"""


@pytest.mark.parametrize("search_path", ["{elsewhere}", ":{elsewhere}", ".:{elsewhere}:"])
def test_a_child_imports_nothing_from_the_folder_the_user_stands_in(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, search_path: str
) -> None:
    for name in OURS + THEIRS:
        (tmp_path / f"{name}.py").write_text(f"open({str(tmp_path / 'executed')!r}, 'a').write(__name__)\n")
    modules = tmp_path / "elsewhere"
    modules.mkdir()
    (modules / "importing_child.py").write_text(IMPORTING)
    monkeypatch.setenv("PYTHONPATH", search_path.format(elsewhere=modules))
    monkeypatch.chdir(tmp_path)
    child = ChildProcess("importing_child", "import")
    child.start({})
    assert set(child.answer(PATIENCE_s)) == set(OURS + THEIRS)
    child.close()
    assert not (tmp_path / "executed").exists()


def test_children_have_the_packages_of_whoever_starts_them(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.delenv("PYTHONPATH", raising=False)
    monkeypatch.chdir(PACKAGES)
    assert child_environment()["PYTHONPATH"] == str(PACKAGES), "a checkout, installed nowhere"
    installed = tmp_path / "lib" / "site-packages"
    monkeypatch.setattr("drivers.core.child_process._PACKAGES", installed)
    assert "PYTHONPATH" not in child_environment(), "before the standard library it would hide parts of that"


def test_every_process_is_started_by_the_one_command() -> None:
    naming = {
        path.relative_to(PACKAGES).as_posix()
        for name in OURS
        for path in (PACKAGES / name).rglob("*.py")
        if re.search(r"\[\s*sys\.executable", path.read_text(encoding="utf-8"))
    }
    assert naming == {"drivers/core/child_process.py"}


# --- what goes wrong in a child -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ("raise KeyError('joint')", r"echo: the program itself failed \(KeyError: 'joint', in .*line 4\)"),
        ("print('a library says hello')", "echo: unexpected output of its process: 'a library says hello'"),
        ("print('[1, 2]')", "unexpected output of its process"),
    ],
)
def test_what_a_child_says_wrongly_is_told_in_words(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, body: str, words: str
) -> None:
    source = f"from drivers.core.child_process import errors_said\n\nwith errors_said():\n    {body}\n"
    child = child_of(source, tmp_path, monkeypatch)
    child.start({})
    with pytest.raises(DeviceError, match=words):
        child.ready(PATIENCE_s)


def test_a_child_that_fails_before_it_can_answer_leaves_one_line_and_no_traceback(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    child = child_of("import no_such_library\n", tmp_path, monkeypatch)
    child.start({})
    with pytest.raises(DeviceError, match="echo: its process has ended"):
        child.ready(PATIENCE_s)
    (line,) = capfd.readouterr().err.splitlines()
    assert line.startswith("child_under_test: the program itself failed (ModuleNotFoundError: No module named 'no_such")


def child_of(source: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> ChildProcess:
    (folder / "child_under_test.py").write_text(source)
    monkeypatch.setenv("PYTHONPATH", str(folder))
    return ChildProcess("child_under_test", "echo")
