"""A rig that leaves the palm to its product code: what is found is kept with the session, which replays with it."""

from __future__ import annotations

import time
from pathlib import Path

import pytest
import yaml

from drivers.emulators.ethercat.server import EmulatedHandProcess
from drivers.emulators.ethercat.shadow_chain import ChainSettings
from drivers.shadow.device.hand_process import HandProcess
from sessions.perception.interpreter import Interpreter, Observer
from sessions.perception.replay import Replay
from sessions.recording.running_session import create_session
from sessions.recording.session import Session
from tactile_lab.rigs.build import build_interpreter
from tactile_lab.rigs.description import Rig, load_rig, rig_of_session
from tactile_lab.rigs.laboratory import open_laboratory
from tactile_lab.rigs.wired import hand_setup
from tests.support.ethercat_wire import JOINTS, cable
from tests.support.wire_rig import wire_rig

pytestmark = pytest.mark.usefixtures("real_time_alone")

_CYCLES = 20


def test_a_session_keeps_the_palm_that_was_found_and_replays_with_it(tmp_path: Path) -> None:
    with (
        cable("s") as (near, far),
        EmulatedHandProcess(far, JOINTS, ChainSettings(palm="0230")),
        open_laboratory(real_rig(tmp_path, near), 0, "thing") as laboratory,
    ):
        live = record(laboratory.rig, tmp_path)
    (session,) = (Session.open(folder) for folder in tmp_path.glob("*-wire-*"))
    kept = rig_of_session(session)
    assert kept.description.hand.palm == "0230"
    interpreter, replayed = heard(kept)
    assert list(Replay(session, interpreter).outcomes()) == []
    assert not interpreter.undecodable
    assert replayed == live
    assert len(live) > _CYCLES


def heard(rig: Rig) -> tuple[Interpreter, list[tuple[int, bytes]]]:
    """What understands a rig's bytes, and the stamps and joint angles of the hand that it understands."""
    interpreter, samples = build_interpreter(rig), list[tuple[int, bytes]]()
    interpreter.listener = lambda _, sample: samples.append((sample.stamp_ns, sample.joints_rad.tobytes()))
    return interpreter, samples


def record(rig: Rig, root: Path) -> list[tuple[int, bytes]]:
    """A session with a hand alone, for some cycles; what was understood of it."""
    interpreter, samples = heard(rig)
    plain, files = rig.plain(), rig.files
    with create_session(
        root, rig="wire", rig_description=plain, object_name="thing", calibration_files=files
    ) as session:
        hand = HandProcess(hand_setup(rig), Observer(session.recorder, interpreter), patience_s=60.0)
        hand.connect()
        while len(samples) <= _CYCLES:
            time.sleep(0.02)
            hand.exchange()
        hand.close()
    return samples


def real_rig(folder: Path, interface: str) -> Rig:
    """A laboratory without emulators, whose hand is on a cable."""
    path = wire_rig(folder, emulated=False)
    content = yaml.safe_load(path.read_text())
    content["wires"]["hand"]["ethercat"]["interface"] = interface
    path.write_text(yaml.safe_dump(content))
    return load_rig(str(path))
