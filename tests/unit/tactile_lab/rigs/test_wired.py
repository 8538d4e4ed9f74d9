"""Rig files of kind wired: what they must say, and what is told when emulators cannot be had."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
import yaml
from gtsam import Pose2, Pose3

from drivers.camera.markers import MarkerSettings
from drivers.core.clock import MonotonicClock
from drivers.core.errors import ConfigurationError, DeviceError
from drivers.emulators.laboratory import virtual_cable as cables
from drivers.emulators.laboratory.emulated_laboratory import EmulatedLaboratory
from drivers.emulators.laboratory.plant_mirror import PlantMirror
from drivers.emulators.laboratory.virtual_cable import virtual_cable
from drivers.shadow.device.hand_settings import HandSettings
from tactile_lab.rigs.build import build_interpreter, check_calibration
from tactile_lab.rigs.description import Rig, load_rig, shipped_rigs
from tactile_lab.rigs.laboratory import WiredLaboratory
from tactile_lab.rigs.wired import emulation_plan, hand_form, hand_setup, with_form
from tactile_lab.slam.tracking.contacts.motion import UNHELD
from tests.support.wire_rig import SHIPPED, wire_rig

SIMULATED = SHIPPED / "calibrations" / "simulated-hand"
CALIBRATION = {role: str(SIMULATED / f"{role}.yaml") for role in ("joints", "motors", "fingertips", "forearm")}


def changed(folder: Path, **changes: Any) -> str:
    path = wire_rig(folder)
    path.write_text(yaml.safe_dump(yaml.safe_load(path.read_text()) | changes))
    return str(path)


def test_the_shipped_rig_is_sound() -> None:
    rig = load_rig("sim-wire")
    check_calibration(rig)
    plan = emulation_plan(rig, 3, "cube-6")
    assert sorted(plan.wires) == ["FF", "LF", "MF", "RF", "TH"]
    assert (plan.simulation.object, plan.seed) == ("cube-6", 3)
    assert hand_setup(rig).hand.cycle_s == rig.description.hand.cycle_s < rig.description.cycle_s
    unstated = rig.description.model_copy(update={"hand": HandSettings(blind_after=5)})
    assert hand_setup(replace(rig, description=unstated)).hand.cycle_s == 0.002
    assert set(build_interpreter(rig).perception.fingertips) == {"FF", "MF", "RF", "LF", "TH"}


def test_the_hand_that_devices_names_has_to_be_on_the_cable(tmp_path: Path) -> None:
    assert hand_setup(load_rig(changed(tmp_path, devices={"hand": "77"}))).wiring().serial == 77
    assert hand_setup(load_rig(changed(tmp_path, devices={"hand": "the old one"}))).wiring().serial is None
    wires = yaml.safe_load(wire_rig(tmp_path).read_text())["wires"]
    wires["hand"]["ethercat"]["serial"] = 634
    both = load_rig(changed(tmp_path, devices={"hand": "77"}, wires=wires))
    with pytest.raises(ConfigurationError, match=r"devices names hand 77, but wires.hand.ethercat.serial hand 634"):
        hand_setup(both)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"wires": None}, "a rig of kind wired needs wires"),
        ({"kind": "simulated", "wires": None}, "emulated is only for kind wired"),
        ({"fingertips": "biotac"}, "others use the palm's"),
        ({"kind": "usb"}, "kind"),
        (
            {"kind": "simulated", "wires": None, "emulated": False, "calibration": CALIBRATION | {"gains": "g.yaml"}},
            "boards, rates and gains are only for a hand on wires",
        ),
    ],
)
def test_descriptions_that_contradict_themselves(tmp_path: Path, changes: dict[str, Any], words: str) -> None:
    with pytest.raises(ConfigurationError, match=words):
        load_rig(changed(tmp_path, **changes))


def left_rig(folder: Path, **hand: Any) -> Rig:
    """A rig with the files of a left hand, and what it says of the hand itself."""
    joints = folder / "calibration.yaml"
    joints.write_bytes(Path(CALIBRATION["joints"]).read_bytes())
    (folder / "general_info.yaml").write_text("side: left\nfingers: [th, ff, mf, rf, lf]\n")
    calibration = CALIBRATION | {"joints": str(joints)}
    return load_rig(changed(folder, calibration=calibration, wires=without_camera(folder), hand=hand))


def test_a_left_hand_is_told_by_its_own_folder_and_a_session_keeps_that(tmp_path: Path) -> None:
    rig = left_rig(tmp_path)
    check_calibration(rig)
    assert hand_setup(rig).wiring().side == emulation_plan(rig, 1, "cube-6").simulation.side == "left"
    assert build_interpreter(rig).perception.form.is_left
    kept = with_form(rig)
    (tmp_path / "general_info.yaml").unlink()
    assert hand_form(kept).is_left
    assert kept.description.simulation.side == "left"


def test_a_left_hands_files_are_refused_on_a_right_hand_before_anything_is_connected(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match=r"general_info\.yaml: is of a left hand, but .*: hand of a right one"):
        check_calibration(left_rig(tmp_path, side="right"))


def test_a_hand_with_two_fingers_cannot_grasp(tmp_path: Path) -> None:
    motors = tmp_path / "motors.yaml"
    motors.write_text("motors: {FFJ0: 0, FFJ3: 1, FFJ4: 2, THJ1: 6, THJ2: 5, THJ4: 9, THJ5: 19}")
    calibration = CALIBRATION | {"motors": str(motors)}
    rig = load_rig(changed(tmp_path, calibration=calibration, wires=without_camera(tmp_path)))
    with pytest.raises(ConfigurationError, match=r"motors\.yaml: is of a hand with FF and TH only"):
        check_calibration(rig)


def test_a_hand_with_a_joint_that_is_never_driven_cannot_grasp(tmp_path: Path) -> None:
    hand = {"gains": {"exceptions": {"LFJ0": {"pwm_per_rad": 0.0, "max_pwm": 0.0}}}}
    wired = load_rig(changed(tmp_path, calibration=CALIBRATION, wires=without_camera(tmp_path), hand=hand))
    sim = load_rig("sim")
    simulated = replace(sim, description=sim.description.model_copy(update={"hand": HandSettings.model_validate(hand)}))
    for rig in (wired, simulated):
        with pytest.raises(ConfigurationError, match=r"hand\.gains: never drives LFJ0, whose largest demand is 0: a"):
            check_calibration(rig)


def test_a_wire_of_a_finger_that_the_hand_does_not_have_is_told(tmp_path: Path) -> None:
    lite = str(shipped_rigs()["sim-lite"].parent / "calibrations" / "simulated-hand" / "motors-lite.yaml")
    calibration = CALIBRATION | {"motors": lite}
    rig = load_rig(changed(tmp_path, calibration=calibration, wires=without_camera(tmp_path)))
    with pytest.raises(ConfigurationError, match=r"wires\.fingertips: names LF, but the hand has FF, MF, RF, TH"):
        check_calibration(rig)


def test_the_published_files_of_a_hand_can_be_named_and_drive_it(tmp_path: Path, lab_data: Path) -> None:
    folder = lab_data / "shadow_hand_config" / "378"
    published = {
        "boards": str(folder / "motor_board_effort_controllers.yaml"),
        "rates": str(folder / "motor_data_polling.yaml"),
        "gains": str(folder / "sr_edc_joint_position_controllers_PWM.yaml"),
    }
    rig = load_rig(changed(tmp_path, calibration=CALIBRATION | published, wires=without_camera(tmp_path)))
    check_calibration(rig)
    setup = hand_setup(rig)
    assert setup.settings().gains.of("FFJ0").damping == 50.0
    assert setup.motor_map().sign[setup.motor_map().numbers["FFJ4"]] == -1
    assert set(published) <= set(rig.files), "a session keeps copies of them"


def without_camera(folder: Path) -> dict[str, Any]:
    wires: dict[str, Any] = yaml.safe_load(wire_rig(folder).read_text())["wires"]
    del wires["camera"]
    return wires


def test_two_fingers_on_one_box(tmp_path: Path) -> None:
    wires = yaml.safe_load(wire_rig(tmp_path).read_text())["wires"]
    wires["fingertips"]["MF"]["host"] = wires["fingertips"]["FF"]["host"]
    with pytest.raises(ConfigurationError, match="FF and MF both use the box at"):
        load_rig(changed(tmp_path, wires=wires))


def test_wires_without_a_stand_in(tmp_path: Path) -> None:
    wires = yaml.safe_load(wire_rig(tmp_path).read_text())["wires"]
    volts = {"wire": "controller", "port": "/dev/ttyS9", "counts_per_N": 1.0, "counts_per_Nm": 1.0}
    other = wires | {"fingertips": wires["fingertips"] | {"FF": volts}}
    with pytest.raises(ConfigurationError, match="the simulated plant feeds only net-ft wires"):
        emulation_plan(load_rig(changed(tmp_path, wires=other)), 0, "cube-6")
    streaming = {"camera": {"stream_hz": 30.0}}
    with pytest.raises(ConfigurationError, match="the emulated camera waits for triggers"):
        emulation_plan(load_rig(changed(tmp_path, simulation=streaming)), 0, "cube-6")
    del wires["hand"]["far_end"]
    with pytest.raises(ConfigurationError, match="far_end"):
        emulation_plan(load_rig(changed(tmp_path, wires=wires)), 0, "cube-6")


def test_a_cable_that_may_not_be_made_says_how_it_can_be(monkeypatch: pytest.MonkeyPatch) -> None:
    refused = cables.subprocess.CompletedProcess(["ip"], 2, "", "RTNETLINK answers: Operation not permitted\n")
    monkeypatch.setattr(cables, "_ip", lambda *words: refused)
    with pytest.raises(DeviceError) as told, virtual_cable("lab0", "lab1"):
        pass
    words = str(told.value)
    assert "no permission to create a virtual network cable (RTNETLINK answers: Operation not permitted)" in words
    assert "sudo ip link add lab0 type veth peer name lab1" in words
    assert "unshare -Urn sh -c 'ip link set lo up; tactile-lab ...'" in words


def test_interfaces_that_are_there_are_used_and_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cables.socket, "if_nameindex", lambda: [(1, "lo"), (2, "lab0"), (3, "lab1")])
    monkeypatch.setattr(cables, "_ip", lambda *words: pytest.fail("nothing is to be made or removed"))
    with virtual_cable("lab0", "lab1"):
        pass


def test_the_plants_memory_carries_state_and_demands_both_ways(tmp_path: Path) -> None:
    path, clock = tmp_path / "plant", MonotonicClock()
    plant = PlantMirror.create(path, clock, np.arange(6.0))
    emulator = PlantMirror(path, clock)
    assert emulator.demands[1].tolist() == list(range(6))
    emulator.drive(np.full(20, 0.5))
    emulator.move_base(np.ones(6))
    duty, base = plant.demands
    assert (duty.tolist(), base.tolist()) == ([0.5] * 20, [1.0] * 6)
    world_T_object = Pose3(Pose2(0.1, 0.2, 0.3))
    plant.publish(clock.now_ns(), np.arange(24.0), np.arange(20.0), base, np.ones((5, 6)), world_T_object)
    assert emulator.joints_rad.tolist() == list(range(24))
    assert emulator.wrenches.shape == (5, 6)
    assert emulator.world_T_object.equals(world_T_object, 1e-12)
    plant.count_lost(5)
    assert emulator.lost_ns == 5
    assert emulator.age_ns >= 0


def test_a_file_that_is_no_plants_memory(tmp_path: Path) -> None:
    (tmp_path / "other").write_bytes(b"something")
    with pytest.raises(DeviceError, match="is not the memory of a simulated plant"):
        PlantMirror(tmp_path / "other", MonotonicClock())
    with pytest.raises(DeviceError, match="the memory of the simulated plant"):
        PlantMirror(tmp_path / "none", MonotonicClock())


def test_an_emulated_laboratory_that_could_not_keep_up_says_so(tmp_path: Path) -> None:
    def place(lost_s: float) -> WiredLaboratory:
        emulators = cast(EmulatedLaboratory, SimpleNamespace(lost_s=lost_s))
        return WiredLaboratory(
            load_rig(str(wire_rig(tmp_path))), MonotonicClock(), MarkerSettings(), emulators=emulators
        )

    assert place(0.0).remarks() == ()
    (remark,) = place(1.26).remarks()
    assert remark == "the emulated laboratory stalled for 1260 ms in all: this computer is too slow or too busy"


@pytest.mark.parametrize("rig", ["sim", "sim-biotac", "sim-wire", "sim-ur"])
def test_what_the_hand_left_in_place_is_expected_there_on_every_rig(rig: str) -> None:
    assert load_rig(rig).description.motion.unheld == UNHELD
