from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from drivers.core.configuration import validate
from drivers.core.errors import ConfigurationError
from drivers.positioner.ur.checks import before_motion, before_program, outside, stop_cause, wrong_version
from drivers.positioner.ur.codec import ArmFlags, ArmState
from drivers.positioner.ur.settings import UrSettings

READY = ArmState(1.0, 7, 2, 1, 1.0, (0.0, 0.0, 0.0), ArmFlags.HEARD | ArmFlags.PROGRAM)
IDLE = replace(READY, runtime_state=1)
HERE = np.array([0.5, 0.0, 0.4, 0.0, 0.0, 0.0])
SETTINGS = UrSettings(payload_kg=4.6, flange_T_forearm=(0.0, 0.0, 0.06, 0.0, 0.0, 0.0))


def test_a_ready_arm_is_taken_over() -> None:
    assert before_program(IDLE, SETTINGS) is None
    assert before_motion(READY, HERE, SETTINGS) is None
    assert stop_cause(READY, SETTINGS) is None


@pytest.mark.parametrize(
    ("arm", "settings", "words"),
    [
        (replace(IDLE, robot_mode=5), SETTINGS, "mode is IDLE, brakes on (5)"),
        (replace(IDLE, robot_mode=3), SETTINGS, "mode is POWER OFF (3)"),
        (replace(IDLE, speed_fraction=0.3), SETTINGS, "speed slider is at 30 %, not 100 %"),
        (replace(IDLE, safety_bits=0b100), SETTINGS, "protective stop"),
        (replace(IDLE, safety_bits=0b1000000), SETTINGS, "emergency stop at the arm"),
        (READY, SETTINGS, "a program is running on the arm"),
        (IDLE, SETTINGS.model_copy(update={"payload_kg": None}), "no payload is stated"),
        (IDLE, SETTINGS.model_copy(update={"flange_T_forearm": None}), "no tool centre is stated"),
    ],
)
def test_an_arm_that_is_not_ready_is_refused_with_value_and_remedy(
    arm: ArmState, settings: UrSettings, words: str
) -> None:
    refusal = before_program(arm, settings)
    assert refusal is not None
    assert words in refusal.what
    assert refusal.remedy


@pytest.mark.parametrize(
    ("q", "words"),
    [
        ([0.5, 0.0, 1.4, 0, 0, 0], "z is 1.400, outside -0.3 to 1.3"),
        ([0.1, 0.1, 0.5, 0, 0, 0], "0.141 m from its axis"),
        ([0.8, 0.0, 0.5, 0, 0, 0], "0.943 m from the arm's base"),
    ],
)
def test_a_place_outside_the_workspace_is_named(q: list[float], words: str) -> None:
    refusal = outside(np.array(q), SETTINGS)
    assert refusal is not None
    assert words in refusal.what


@pytest.mark.parametrize("version", ["3.11.0.82155", "3.15.8", "5.6.0", "5.25.1.118000"])
def test_versions_of_both_series_are_known_from_their_first_on(version: str) -> None:
    assert wrong_version(version) is None


@pytest.mark.parametrize("version", ["3.10.1", "5.5.1", "1.8.2", "10.7.0"])
def test_other_versions_are_refused_by_their_number(version: str) -> None:
    refusal = wrong_version(version)
    assert refusal is not None
    assert refusal.what == f"PolyScope {version} is not known to this program"


def test_an_arm_outside_its_workspace_may_not_move() -> None:
    refusal = before_motion(READY, np.array([0.5, 0.0, 1.4, 0, 0, 0]), SETTINGS)
    assert refusal is not None
    assert "z is 1.400" in refusal.what


def test_a_load_felt_at_rest_means_a_wrong_payload() -> None:
    refusal = before_motion(replace(READY, force_N=(0.0, 0.0, -45.0)), HERE, SETTINGS)
    assert refusal is not None
    assert "45 N at rest with a payload of 4.6 kg" in refusal.what


@pytest.mark.parametrize(
    ("arm", "words"),
    [
        (replace(READY, flags=ArmFlags.PROGRAM), "has stopped answering"),
        (replace(READY, safety_bits=0b10000000), "emergency stop"),
        (replace(READY, flags=ArmFlags.HEARD), "the program on the arm was stopped"),
        (replace(READY, force_N=(50.0, 0.0, 50.0)), "force 71 N at the tool centre is over the limit of 60 N"),
        (replace(READY, flags=READY.flags | ArmFlags.BRAKED), "takes no more targets"),
        (replace(READY, speed_fraction=0.5), "speed slider is at 50 %"),
    ],
)
def test_what_ends_a_session_is_named(arm: ArmState, words: str) -> None:
    cause = stop_cause(arm, SETTINGS)
    assert cause is not None
    assert words in cause.what


def test_a_person_who_leads_the_arm_may_push_it() -> None:
    assert stop_cause(replace(READY, force_N=(90.0, 0, 0), flags=READY.flags | ArmFlags.FREE), SETTINGS) is None


@pytest.mark.parametrize(
    ("stated", "words"),
    [
        ({"centre_of_gravity_m": [0, 0, 120]}, "centre_of_gravity_m: must be metres, within 1 of the flange"),
        ({"flange_T_forearm": [0, 0, 60, 0, 0, 1.57]}, "flange_T_forearm: must be metres"),
        ({"flange_T_forearm": [0, 0, 0.06, 0, 0, 90]}, "flange_T_forearm: must turn by radians"),
    ],
)
def test_millimetres_and_degrees_are_refused(stated: dict[str, object], words: str) -> None:
    with pytest.raises(ConfigurationError, match=words):
        validate(stated, UrSettings, where="rig.yaml")


def test_an_empty_reach_is_refused() -> None:
    with pytest.raises(ValueError, match="reach_m"):
        UrSettings(reach_m=(0.8, 0.2))
