"""Sessions over real wires, in a laboratory of emulators that is running already."""

from __future__ import annotations

import json
from pathlib import Path

from drivers.core.contacts import Grasp
from drivers.emulators.laboratory.emulated_laboratory import EmulatedLaboratory
from drivers.shadow.protocol.palm_images import PALMS
from sessions.conductor.session_outcome import SessionOutcome
from sessions.perception.event_outcomes import TareReport
from sessions.perception.replay import Replay
from sessions.recording.session import Session
from sessions.recording.traffic import schemas
from tactile_lab.rigs.build import build_interpreter
from tactile_lab.rigs.description import Rig, rig_of_session
from tactile_lab.rigs.laboratory import WiredLaboratory
from tactile_lab.slam.tactile_slam import TactileSlam
from tactile_lab.workflow import running
from tactile_lab.workflow.attending import Attendance
from tests.support.at_phase import At


def emulated_laboratory(laboratory: WiredLaboratory) -> EmulatedLaboratory:
    """The emulators of an emulated laboratory."""
    assert laboratory.emulators is not None
    return laboratory.emulators


def run(
    rig: Rig,
    laboratory: WiredLaboratory,
    root: Path,
    progress: At,
    grasps: int = 1,
    attendance: Attendance = running.ALONE,
) -> tuple[SessionOutcome, Path]:
    """A session as ``tactile-lab run`` makes it, in a laboratory that is running already."""
    request = running.SessionRequest(rig.source, "box-10x6x4", root, grasps=grasps)
    slam = TactileSlam(running.slam_settings("joint", 2, rig.description.motion), 0)
    session = running._new_session(rig, laboratory, slam, request, ())
    return running._record(session, rig, laboratory, slam, request, progress, attendance), session.folder


def check_ended_in_order(folder: Path, words: str) -> None:
    """A readable recording that says why, with the last cycles, and a hand that was left without demands."""
    session = Session.open(folder)
    assert session.manifest.status == "failed"
    assert words in session.manifest.problem
    reader = session.traffic()
    messages = list(reader.messages())
    assert not reader.loss
    (stop,) = [json.loads(message.data) for message in messages if message.topic == schemas.SAFETY_TOPIC]
    assert words in stop["cause"]
    assert stop["cycles"] or "camera" in words  # a lost connection is noticed before the first cycle has ended
    sent = [message.data for message in messages if message.topic == schemas.transmitted_topic("hand")]
    if words != "its process has ended":  # a killed hand process sends nothing more: the motors halt after 20 ms
        assert not any(PALMS["0220"].decode_command(sent[-1]).motor_data)
    replay = Replay(session, build_interpreter(rig_of_session(session)))
    assert all(isinstance(outcome, Grasp | TareReport) for outcome in replay.outcomes())
    assert not replay.loss
