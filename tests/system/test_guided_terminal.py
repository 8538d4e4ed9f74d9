"""A person at a terminal guides a session on the simulated rig, key by key."""

from __future__ import annotations

import os
import sys
import termios
from pathlib import Path
from typing import Any

import pexpect
import pytest

from sessions.recording.listing import list_sessions
from sessions.recording.session import Session
from sessions.recording.traffic import schemas
from tactile_lab.cli.main import main
from tactile_lab.workflow.finishing import differing_files

PROGRAM = str(Path(__file__).parents[1] / "support" / "guided_program.py")
PATIENCE_s = 600  # for a loaded machine; nothing is measured
ENVIRONMENT = {
    **os.environ,
    "OPENBLAS_NUM_THREADS": "1",
    "TERM": "xterm",
    "NO_COLOR": "1",
    "PYTHONPATH": str(Path(__file__).parents[2]),
}


class Terminal:
    """The program on a terminal of its own, and the cable of a fingertip."""

    def __init__(self, folder: Path, *options: str) -> None:
        self.cable, self.out = folder / "unplugged", folder / "runs"
        words = [PROGRAM, str(self.cable), "run", "--mode", "guided", "--out", str(self.out), "--pace", "0", *options]
        self.program = pexpect.spawn(
            sys.executable, words, env=ENVIRONMENT, encoding="utf-8", dimensions=(50, 130), timeout=PATIENCE_s
        )

    def until(self, text: str, then: str = "") -> None:
        """Wait for a text, then press keys."""
        self.program.expect_exact(text)
        self.program.send(then)

    def ended(self) -> int:
        """Exit code."""
        self.program.expect(pexpect.EOF)
        self.modes_at_end = self.modes
        self.program.close()
        assert self.program.exitstatus is not None
        return self.program.exitstatus

    @property
    def modes(self) -> list[Any]:
        """How the terminal treats what is typed."""
        return termios.tcgetattr(self.program.child_fd)

    @property
    def session(self) -> Session:
        (summary,) = list_sessions(self.out)
        return Session.open(summary.folder)


def events(session: Session) -> str:
    messages = session.traffic().messages()
    return "\n".join(message.data.decode() for message in messages if message.topic == schemas.LOG_TOPIC)


def grasp(terminal: Terminal) -> None:
    """One grasp as the prompts say, up to the hold."""
    terminal.until("SPACE: continue", " ")
    terminal.until("Move the hand", "g")
    terminal.until("Close the fingers", "g")


@pytest.mark.long
def test_person_guides_a_session_with_undo_pause_an_unplugged_sensor_and_a_resume(tmp_path: Path) -> None:
    terminal = Terminal(tmp_path, "--grasps", "3", "--seed", "2")
    before = terminal.modes
    terminal.until("Place the object", "nbox on its side\r")
    terminal.until("note: box on its side")
    terminal.until("leave that out", " ")
    grasp(terminal)
    terminal.until("Hold still", "p")
    terminal.until("e: end session", "p")
    terminal.until("resumed", " ")
    terminal.until("Turn the object", "g")
    terminal.until("Ready for the next grasp", "u")
    terminal.until("undone")
    terminal.cable.touch()
    terminal.until("no usable reading from MF")
    terminal.cable.unlink()
    terminal.until("readings from MF are back", "p")
    terminal.until("resumed")
    grasp(terminal)
    terminal.until("Hold still", " ")
    terminal.until("Turn the object", "g")
    terminal.until("Ready for the next grasp", "e")
    terminal.until("press again to end", "e")
    assert terminal.ended() == 3  # done, with the loss of the unplugged sensor
    assert terminal.modes_at_end == before
    session = terminal.session
    assert session.manifest.status == "closed"
    assert session.manifest.counts["grasps"] == 1
    assert all("ft/MF" in loss for loss in session.manifest.data_loss)
    assert (session.folder / "attachments" / "notes.txt").read_text() == "box on its side\n"
    told = events(session)
    for text in ("paused: by the operator", "grasp 1 undone", "no usable reading from MF", "are back"):
        assert text in told
    again = tmp_path / "again"
    with pytest.raises(SystemExit) as ended:
        main(["session", "replay", str(session.folder), "--into", str(again)])
    assert ended.value.code in (0, 3)
    assert differing_files(session.results, again) == []
