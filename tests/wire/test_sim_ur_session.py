"""Sessions on the rig sim-ur in which the arm stops: ended in order, recorded, and the next session runs."""

from __future__ import annotations

import shutil
from importlib.util import find_spec
from pathlib import Path

import pytest

from drivers.core.errors import DeviceError
from sessions.conductor.session_outcome import Ending
from tactile_lab.rigs.description import load_rig
from tactile_lab.rigs.laboratory import WiredLaboratory, open_laboratory
from tests.support.wire_rig import wire_rig
from tests.support.wire_sessions import At, check_ended_in_order, run

pytestmark = [
    pytest.mark.long,
    pytest.mark.usefixtures("real_time_alone"),
    pytest.mark.skipif(find_spec("rtde_control") is None, reason="the package ur-rtde is not installed"),
    pytest.mark.skipif(shutil.which("ip") is None, reason="no ip command to make virtual interfaces with"),
]

STOPS = (
    ("protective stop", "release", "base: protective stop"),
    ("stop program", "release", "base: the program on the arm was stopped"),
    ("unplug", "plug", "base: the arm has stopped answering"),
)


def test_a_stop_of_the_arm_ends_the_session_in_order_and_the_next_one_runs(tmp_path: Path) -> None:
    rig = load_rig(str(wire_rig(tmp_path, "sim-ur")))
    try:
        with open_laboratory(rig, 0, "box-10x6x4") as laboratory:
            assert isinstance(laboratory, WiredLaboratory)
            assert laboratory.emulators is not None
            arm = laboratory.emulators.hosts["base"]
            for number, (event, remedy, words) in enumerate(STOPS):
                stop = At("descend", lambda event=event: arm.give({"event": event}))  # type: ignore[misc]
                outcome, folder = run(rig, laboratory, tmp_path / str(number), stop)
                assert outcome.ending is Ending.STOPPED
                assert words in outcome.reason
                check_ended_in_order(folder, words)
                arm.give({"event": remedy})
            outcome, _ = run(rig, laboratory, tmp_path / "last", At())
            assert outcome.ending is Ending.COMPLETE, outcome.reason
    except DeviceError as error:
        if "no right" in str(error) or "no permission" in str(error):
            pytest.skip(str(error))
        raise
