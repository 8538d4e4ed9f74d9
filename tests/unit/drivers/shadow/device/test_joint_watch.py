"""What joint sensors may not say: beyond their calibrated counts, faster than a joint turns, the same while driven."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from drivers.shadow.device.joint_watch import JointWatch, SensorLimits
from drivers.shadow.device.motor_watch import Fault
from drivers.shadow.model.joint_calibration import JointCalibration
from drivers.shadow.model.kinematics import JOINT_INDEX, JOINT_LIMITS_rad, joint_vector
from drivers.shadow.model.motors import MotorMap, drivable_range_rad
from drivers.shadow.protocol.palm_codec import SENSORS
from tactile_lab import rigs

CALIBRATION = JointCalibration.load(Path(rigs.__file__).parent / "calibrations" / "simulated-hand" / "joints.yaml")
MOTORS = MotorMap.load()
ALL, MS = np.ones(20, dtype=bool), 1_000_000


class Watched:
    """Readings given to a watch, a millisecond apart."""

    def __init__(self, **limits: float) -> None:
        self.watch = JointWatch(CALIBRATION, MOTORS, np.full(20, 400.0), SensorLimits(**limits), "hand")
        self.now_ns = 0

    def read(self, after_ms: int = 1, channels: dict[str, int] | None = None, **angles_rad: float) -> Fault | None:
        self.now_ns += after_ms * MS
        sensors = np.rint(CALIBRATION.raw_counts(joint_vector(angles_rad)))
        for name, count in (channels or {}).items():
            sensors[SENSORS.index(name)] = count
        self.watch.see(sensors.astype(np.uint16), CALIBRATION.angles_rad(sensors), self.now_ns)
        return self.watch.fault(ALL)


def driving(joint: str, pwm: int) -> np.ndarray[tuple[int], np.dtype[np.int16]]:
    words = np.zeros(20, np.int16)
    words[MOTORS.numbers[joint]] = pwm
    return words


def test_every_posture_within_the_published_limits_is_believed() -> None:
    for limits_rad in JOINT_LIMITS_rad.T:
        watched = Watched()
        sensors = np.rint(CALIBRATION.raw_counts(limits_rad)).astype(np.uint16)
        watched.watch.see(sensors, CALIBRATION.angles_rad(sensors), MS)
        assert watched.watch.fault(ALL) is None


@pytest.mark.parametrize(
    ("channel", "count", "words"),
    [
        (
            "FFJ3",
            0,
            r"hand, FFJ3 \(motor 1\): stopped: its sensor reads 0 counts, calibrated are 946 to 2487. Its",
        ),
        ("FFJ3", 3000, "calibrated are 946 to 2487. Is this the hand's own calibration file"),
        ("MFJ2", 4095, r"hand, MFJ2 \(motor 3\): stopped: its sensor reads 4095 counts"),
        ("THJ2", 4095, r"hand, THJ2 \(motor 5\): stopped"),
        ("THJ5B", 4095, r"hand, THJ5 \(motor 19\): stopped: its sensor reads 4095 counts"),
        ("WRJ1A", 0, r"hand, WRJ1 \(motor 18\): stopped: its sensor reads 0 counts"),
    ],
)
def test_a_reading_that_was_never_calibrated_names_joint_counts_and_what_to_look_at(
    channel: str, count: int, words: str
) -> None:
    fault = Watched().read(channels={channel: count})
    assert fault is not None
    with pytest.raises(type(fault.error()), match=words):
        raise fault.error()


def test_only_driven_joints_stop_the_hand_and_all_are_told() -> None:
    watched = Watched()
    watched.read(channels={"FFJ3": 0})
    driven = ALL.copy()
    driven[MOTORS.numbers["FFJ3"]] = False
    assert watched.watch.fault(driven) is None
    assert watched.watch.problems() == ["hand, FFJ3: its sensor reads 0 counts, calibrated are 946 to 2487"]


def test_a_joint_may_snap_but_not_jump() -> None:
    watched = Watched()
    watched.read(FFJ3=0.5)
    assert watched.read(FFJ3=0.6) is None
    assert watched.read(after_ms=10, FFJ3=0.9) is None
    fault = watched.read(FFJ3=1.2)
    assert fault is not None
    assert "jumps by more than a joint can turn" in fault.what
    assert watched.read(FFJ3=1.2) is None
    assert watched.read(after_ms=500, FFJ3=0.2) is None, "after a pause it may be anywhere"


@pytest.mark.parametrize(
    ("pwm", "torque", "turns", "stops"),
    [
        (200, 0.0, False, True),
        (-200, np.nan, False, True),
        (100, 0.0, False, False),
        (200, 300.0, False, False),
        (200, 0.0, True, False),
    ],
)
def test_a_joint_that_is_driven_against_nothing_has_to_move(pwm: int, torque: float, turns: bool, stops: bool) -> None:
    watched, words = Watched(), driving("FFJ0", pwm)
    faults = []
    for step in range(400):
        watched.read(FFJ1=0.4 + 0.001 * step * turns, FFJ2=0.4 + 0.001 * step * turns)
        faults.append(watched.watch.frozen(words, np.full(20, torque), watched.now_ns))
    told = [fault for fault in faults if fault is not None]
    assert bool(told) == stops
    if told:
        assert faults.index(told[0]) == pytest.approx(100, abs=2)
        assert told[0].where == "hand, FFJ1 (motor 0)"


def test_targets_stay_within_what_the_calibration_covers() -> None:
    tables = {joint: [(1000.0, 0.0), (3000.0, 90.0)] for joint in JOINT_INDEX}
    narrow = JointCalibration(tables | {"FFJ3": [(1000.0, 10.0), (3000.0, 60.0)]}, {})
    low_deg, high_deg = np.degrees(drivable_range_rad(MOTORS, narrow, 0.2)[MOTORS.numbers["FFJ3"]])
    assert (low_deg, high_deg) == (pytest.approx(0.0), pytest.approx(70.0))
    beside = JointCalibration(tables | {"FFJ3": [(1000.0, 200.0), (3000.0, 260.0)]}, {})
    assert np.degrees(drivable_range_rad(MOTORS, beside, 0.2)[MOTORS.numbers["FFJ3"]]) == pytest.approx([-15.0, 90.0])
