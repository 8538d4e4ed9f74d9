"""Sessions on the rig sim-ur: the arm stops, or a person leads it. In order, recorded, and the next one runs."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator, Sequence
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from drivers.core.contacts import Array
from drivers.core.errors import DeviceError
from drivers.positioner.ur.codec import ArmFlags, decode_arm_status
from sessions.conductor.session_outcome import Ending
from sessions.guided.operator import Ask, Panel, Request, Stage
from sessions.recording.session import Session
from sessions.recording.traffic import schemas
from tactile_lab.rigs.description import Rig, load_rig
from tactile_lab.rigs.laboratory import WiredLaboratory, open_laboratory
from tactile_lab.workflow.attending import Attendance
from tests.support.at_phase import At
from tests.support.wire_rig import wire_rig
from tests.support.wire_sessions import check_ended_in_order, emulated_laboratory, run

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


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Rig:
    return load_rig(str(wire_rig(tmp_path_factory.mktemp("rig"), "sim-ur")))


@pytest.fixture(scope="module")
def laboratory(rig: Rig) -> Iterator[WiredLaboratory]:
    try:
        with open_laboratory(rig, 0, "box-10x6x4") as place:
            assert isinstance(place, WiredLaboratory)
            yield place
    except DeviceError as error:
        if "no right" in str(error) or "no permission" in str(error):
            pytest.skip(str(error))
        raise


def test_a_stop_of_the_arm_ends_the_session_in_order_and_the_next_one_runs(
    rig: Rig, laboratory: WiredLaboratory, tmp_path: Path
) -> None:
    arm = emulated_laboratory(laboratory).hosts["base"]
    for number, (event, remedy, words) in enumerate(STOPS):
        stop = At("descend", lambda event=event: arm.give({"event": event}))  # type: ignore[misc]
        outcome, folder = run(rig, laboratory, tmp_path / str(number), stop)
        assert outcome.ending is Ending.STOPPED
        assert words in outcome.reason
        check_ended_in_order(folder, words)
        arm.give({"event": remedy})
    outcome, _ = run(rig, laboratory, tmp_path / "last", At())
    assert outcome.ending is Ending.COMPLETE, outcome.reason


class Leader:
    """A person who pushes the arm once in every stage of a grasp, then gives the grasp up and ends.

    Each key is pressed every half a second until the stage is over: fingertips that still swing are not zeroed.
    """

    attended = True
    _answers: tuple[tuple[Stage, Ask], ...] = (
        (Stage.PLACE, Ask.NEXT),
        (Stage.GUIDE, Ask.NEXT),
        (Stage.CLOSE, Ask.NEXT),
        (Stage.HOLD, Ask.GIVE_UP),
        (Stage.RELEASE, Ask.NEXT),
        (Stage.PLACE, Ask.END),
    )

    def __init__(self, push: Callable[[], None]) -> None:
        self._push, self._left = push, list(self._answers)
        self._stage = Stage.ESTIMATE
        self._cycles = 0

    def show(self, panel: Panel) -> None:
        if panel.stage != self._stage:
            if self._left and self._left[0][0] == self._stage:
                del self._left[0]
            self._stage, self._cycles = panel.stage, 0

    def requests(self) -> Sequence[Request]:
        self._cycles += 1
        if not self._left or self._left[0][0] != self._stage:
            return []
        if self._cycles == 25:
            self._push()
        return [Request(self._left[0][1])] if self._cycles % 50 == 0 else []


def heights_m(folder: Path) -> tuple[Array, Array]:
    """Heights of the arm in a recording, and whether a person could lead it then, shapes (n,)."""
    statuses = [
        decode_arm_status(message.data)
        for message in Session.open(folder).traffic().messages()
        if message.topic == schemas.received_topic("base")
    ]
    return np.array([each.q[2] for each in statuses]), np.array([ArmFlags.FREE in each.arm.flags for each in statuses])


def test_a_person_leads_the_arm_while_guiding_and_opening_and_at_no_other_time(
    rig: Rig, laboratory: WiredLaboratory, tmp_path: Path
) -> None:
    arm = emulated_laboratory(laboratory).hosts["base"]
    leader = Leader(lambda: arm.give({"event": "lead", "value": 0.02}))
    outcome, folder = run(rig, laboratory, tmp_path, At(), attendance=Attendance(leader, True, "hand"))
    assert outcome.ending is Ending.COMPLETE, outcome.reason
    heights, is_free = heights_m(folder)
    changes = np.flatnonzero(np.diff(is_free.astype(int)))
    assert len(changes) == 4  # free while guided and while opened
    led_m = heights[changes[1::2]] - heights[changes[::2]]
    np.testing.assert_allclose(led_m, 0.02, atol=0.002)
    held = ~(is_free[1:] | is_free[:-1])
    assert np.abs(np.diff(heights))[held].max() < 1e-3
