"""What ``rig check`` tells to do next: one thing after the other, and nothing that needs an earlier one first."""

from __future__ import annotations

from pathlib import Path

from tactile_lab.rigs.checks.findings import Finding, told
from tactile_lab.rigs.checks.next_steps import next_steps

SOUND = Finding("hand", True, "hand 634, in operation")
SILENT = told("fingertip MF", ["no answer from 192.168.1.12. Check the box's power"], ["0 messages/s"], {})
REFUSED = Finding("hand", False, "its data are of another size; those of palm 0240 are 74. Ask for its layout")
FOREARM = Finding("calibration forearm", False, "was never measured. Calibrate it: tactile-lab calibrate forearm")
LENS = Finding("calibration camera", False, "was never measured. Calibrate it: tactile-lab calibrate camera")
JOINTS = Finding("calibration joints", False, "did not pass its limits. Calibrate again: tactile-lab calibrate joints")


def test_a_device_that_does_not_work_comes_before_everything() -> None:
    assert next_steps("sim-wire", [FOREARM, SOUND, SILENT], moved=False) == [
        "fingertip MF: no answer from 192.168.1.12. Check the box's power",
        "Check again: tactile-lab rig check sim-wire",
    ]


def test_what_a_device_refuses_is_told_with_its_remedy() -> None:
    first, _ = next_steps("sim-wire", [REFUSED], moved=False)
    assert first == f"hand: {REFUSED.detail}"
    first, _ = next_steps("sim-wire", [Finding("base", False, "base: protective stop. Release it")], moved=False)
    assert first == "base: protective stop. Release it"


def test_motors_come_before_calibrations_and_those_in_the_order_in_which_they_need_each_other() -> None:
    steps = next_steps("sim-wire", [JOINTS, FOREARM, LENS, SOUND], moved=False)
    assert [step.split(":")[0] for step in steps] == [
        "Clear the space around the hand, then nudge every motor",
        "calibration camera",
        "calibration forearm",
        "calibration joints",
        "First session, over an empty table",
    ]


def test_a_rig_that_is_ready_is_told_how_to_begin() -> None:
    assert next_steps("sim-wire", [SOUND], moved=True) == [
        "First session, over an empty table: tactile-lab run --rig sim-wire --grasps 1"
    ]
    assert next_steps("sim", [SOUND], moved=False) == ["First session: tactile-lab run --rig sim --grasps 1"]


def test_a_rig_of_single_devices_is_followed_by_one_of_all(tmp_path: Path) -> None:
    file = tmp_path / "hand.yaml"
    file.write_text("kind: hand\n")
    nudge = f"Clear the space around the hand, then nudge every motor: tactile-lab rig check {file} --move"
    (together,) = next_steps(str(file), [SOUND], moved=True)
    assert together.startswith("The other devices alone, then all of them in one rig file of kind wired")
    assert next_steps(str(file), [SOUND], moved=False) == [nudge, together]
    file.write_text("kind: fingertips\n")
    assert next_steps(str(file), [SOUND], moved=False) == [together]
