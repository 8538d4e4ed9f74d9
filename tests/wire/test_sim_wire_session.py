"""Sessions over real wires: one that is completed and replayed, and what becomes of one when a device dies."""

from __future__ import annotations

import os
import shutil
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from drivers.core.contacts import Grasp
from drivers.core.errors import DeviceError
from sessions.conductor.decisions import SessionRoles
from sessions.conductor.session_outcome import Ending, SessionOutcome
from sessions.perception.replay import Replay
from sessions.recording.recorder import Recorder
from sessions.recording.session import Session
from sessions.recording.traffic import schemas
from sessions.rig_runtime.rig_runtime import RigRuntime
from tactile_lab.autonomy.estimator_process import EstimatorProcess
from tactile_lab.rigs.build import build_interpreter
from tactile_lab.rigs.description import Rig, load_rig, rig_of_session
from tactile_lab.rigs.laboratory import WiredLaboratory, open_laboratory
from tactile_lab.workflow import running
from tactile_lab.workflow.attending import roles_for
from tests.support.at_phase import At
from tests.support.wire_hand_faults import HAND_FAULTS, run_fault
from tests.support.wire_rig import wire_rig
from tests.support.wire_sessions import check_ended_in_order, emulated_laboratory, run

pytestmark = pytest.mark.usefixtures("real_time_alone")


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Rig:
    if shutil.which("ip") is None:
        pytest.skip("no ip command to make virtual interfaces with")
    return load_rig(str(wire_rig(tmp_path_factory.mktemp("rig"))))


@pytest.fixture(scope="module")
def laboratory(rig: Rig) -> Iterator[WiredLaboratory]:
    try:
        opened = open_laboratory(rig, 0, "box-10x6x4")
        with opened as place:
            assert isinstance(place, WiredLaboratory)
            yield place
    except DeviceError as error:
        if "no right" in str(error) or "no permission" in str(error):
            pytest.skip(str(error))
        raise


def run_killing(rig: Rig, laboratory: WiredLaboratory, root: Path, device: str) -> tuple[SessionOutcome, Path]:
    """The same, with a device's emulator killed while the hand comes down, and started again for the next session."""
    host = emulated_laboratory(laboratory).hosts[device]
    try:
        return run(rig, laboratory, root, At("descend", host.kill))
    finally:
        host.start()
        host.await_ready()


def test_a_session_is_completed_and_replays_to_the_same_grasp(
    rig: Rig, laboratory: WiredLaboratory, tmp_path: Path
) -> None:
    outcome, folder = run(rig, laboratory, tmp_path, At())
    assert outcome.ending is Ending.COMPLETE, outcome.reason
    session = Session.open(folder)
    assert session.manifest.status == "closed"
    replay = Replay(session, build_interpreter(rig_of_session(session)))
    (grasp,) = [each for each in replay.outcomes() if isinstance(each, Grasp)]
    assert not replay.loss
    (live,) = outcome.grasps
    assert len(live.contacts) >= 3
    assert [each.finger for each in grasp.contacts] == [each.finger for each in live.contacts]
    for ours, theirs in zip(live.contacts, grasp.contacts, strict=True):
        assert ours.point_world_m.tobytes() == theirs.point_world_m.tobytes()
    transports = {"hand", "base", "camera", "ft/FF", "ft/MF", "ft/RF", "ft/LF", "ft/TH"}
    recorded = {schemas.received_transport(message.topic) for message in session.traffic().messages()}
    assert transports <= recorded


@pytest.mark.parametrize(
    ("device", "words"),
    [
        pytest.param("camera", "camera: lost", marks=pytest.mark.long),
        ("hand", "no valid status for 2 s"),
        pytest.param("ft/MF", "MF: no reading from the fingertip", marks=pytest.mark.long),
        pytest.param("base", "cycles in a row without a status", marks=pytest.mark.long),
    ],
)
def test_a_device_that_dies_ends_the_session_in_order(
    rig: Rig, laboratory: WiredLaboratory, tmp_path: Path, device: str, words: str
) -> None:
    outcome, folder = run_killing(rig, laboratory, tmp_path, device)
    assert outcome.ending is Ending.STOPPED
    assert words in outcome.reason
    check_ended_in_order(folder, words)


@pytest.mark.long
def test_a_world_that_stands_still_ends_the_session_in_order(
    rig: Rig, laboratory: WiredLaboratory, tmp_path: Path
) -> None:
    outcome, folder = run_killing(rig, laboratory, tmp_path, "plant")
    assert outcome.ending is Ending.STOPPED
    seen = "does not follow" if "does not follow" in outcome.reason else "the emulated laboratory does not respond"
    check_ended_in_order(folder, seen)


@pytest.mark.long
@pytest.mark.parametrize("name", ["sensor frozen", "one motor silent", "motor at 57 C", "link gone for 0.5 s"])
def test_a_fault_of_the_hand_takes_its_demands_and_is_told_by_name(
    rig: Rig, laboratory: WiredLaboratory, tmp_path: Path, name: str
) -> None:
    """All of them: ``python -m tests.support.wire_hand_fault_table``."""
    found = run_fault(fault := HAND_FAULTS[name], rig, laboratory, tmp_path)
    assert fault.told in found.reason
    assert not found.reason or found.late_cycles <= 2


@pytest.mark.long  # quicker: a hand that dies, in test_hand_process.py
def test_a_hand_process_that_dies_ends_the_session_in_order(
    rig: Rig, laboratory: WiredLaboratory, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    runtimes: list[RigRuntime] = []

    def kept(place: WiredLaboratory, recorder: Recorder) -> RigRuntime:
        runtimes.append(made(place, recorder))
        return runtimes[-1]

    def kill() -> None:
        os.kill(runtimes[0].hand._child.process_id, signal.SIGKILL)  # type: ignore[attr-defined]

    made = WiredLaboratory.runtime
    monkeypatch.setattr(WiredLaboratory, "runtime", kept)
    outcome, folder = run(rig, laboratory, tmp_path, At("descend", kill))
    assert outcome.ending is Ending.STOPPED
    assert "its process has ended" in outcome.reason
    check_ended_in_order(folder, "its process has ended")


@pytest.mark.long
def test_an_estimation_whose_process_dies_ends_the_session_in_order(
    rig: Rig, laboratory: WiredLaboratory, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    crews: list[SessionRoles] = []

    def kept(*args: Any, **kwargs: Any) -> SessionRoles:
        crews.append(roles_for(*args, **kwargs))
        return crews[-1]

    def kill() -> None:
        estimator = crews[0].estimator
        assert isinstance(estimator, EstimatorProcess)
        os.kill(estimator.process_id, signal.SIGKILL)

    monkeypatch.setattr(running, "roles_for", kept)
    outcome, folder = run(rig, laboratory, tmp_path, At("descend", kill))
    assert outcome.ending is Ending.STOPPED
    check_ended_in_order(folder, "estimation: its process has ended")
