from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.core.clock import VirtualClock
from drivers.core.errors import CodecError, DeviceError
from drivers.core.transports import Datagram, MemoryTransport, ReplayTransport
from drivers.shadow.device.hand import ShadowHand
from drivers.shadow.device.hand_samples import HandDecoder, HandSample
from drivers.shadow.device.hand_settings import HandSettings
from drivers.shadow.device.motor_polling import MotorMemory, MotorPolling
from drivers.shadow.device.tactile_requests import BIOTAC_ROTATION, TactileQuestion, TactileRotation
from drivers.shadow.model.gains import GainTable, JointGains
from drivers.shadow.model.joint_calibration import JointCalibration
from drivers.shadow.model.kinematics import JOINT_INDEX, joint_vector
from drivers.shadow.model.motors import MotorMap
from drivers.shadow.protocol import palm_codec
from drivers.shadow.protocol.motor_data import FromMotor, MotorFlag, ToMotor
from drivers.shadow.protocol.palm_codec import PalmCommand, PalmStatus
from tactile_lab import rigs

SIMULATED = Path(rigs.__file__).parent / "calibrations" / "simulated-hand"
CALIBRATION = JointCalibration.load(SIMULATED / "joints.yaml")
MOTORS = MotorMap.load(SIMULATED / "motors.yaml")
CYCLE_ns = 10_000_000
RADIANS_PER_COUNT = 2e-5
"""What the fake's joints turn in a cycle for each count of duty cycle."""
QUICK = HandSettings(soft_start_s=0.0)


class FakePalm:
    """The least that behaves like a palm: answers the previous command, moves joints in proportion to the duty."""

    def __init__(self, clock: VirtualClock, motors: MotorMap = MOTORS) -> None:
        self.clock, self.motors = clock, motors
        self.joints_rad = joint_vector({"FFJ3": 0.4, "FFJ1": 0.2, "FFJ2": 0.3, "THJ4": 0.6, "LFJ5": 0.2})
        self.commands: list[PalmCommand] = []
        self.flags, self.temperature_C = np.zeros(20, np.uint16), np.full(20, 30)
        self.silent: set[int] = set()
        self.delay_ns = 0
        self.mute = self.unwritten = self.frozen = False
        self.garbage = b""
        self._waiting: list[Datagram] = []
        self._payload = b""

    @property
    def pwm(self) -> list[int]:
        return list(self.commands[-1].motor_data)

    def write(self, payload: bytes) -> None:
        self.clock.sleep_until_ns(self.clock.now_ns() + self.delay_ns)
        previous = self.commands[-1] if self.commands else PalmCommand()
        self.commands.append(palm_codec.decode_command(payload))
        duty = np.array(self.commands[-1].motor_data, int) * self.motors.sign
        for motor, name in enumerate(self.motors.names):
            moved = [f"{name[:2]}J1", f"{name[:2]}J2"] if name.endswith("J0") else [name]
            for joint in moved:
                self.joints_rad[JOINT_INDEX[joint]] += duty[motor] * RADIANS_PER_COUNT / len(moved)
        if not self.frozen or not self._payload:
            self._payload = self.garbage or palm_codec.encode_status(self._status(previous))
        if not self.mute:
            self._waiting.append(Datagram(self._payload, self.clock.now_ns()))

    def read(self) -> list[Datagram]:
        waiting, self._waiting = self._waiting, []
        return waiting

    def _status(self, command: PalmCommand) -> PalmStatus:
        asked = np.arange(command.which_motors, 20, 2)
        answers = {
            FromMotor.FLAGS: self.flags,
            FromMotor.TEMPERATURE: self.temperature_C * 256,
            FromMotor.PWM: np.array(command.motor_data, int) & 0xFFFF,
        }
        misc = answers.get(FromMotor(command.from_motor_data_type), np.zeros(20, int))[asked]
        return PalmStatus(
            edc_command=0 if self.unwritten else min(command.edc_command, 1),
            sensors=np.clip(np.rint(CALIBRATION.raw_counts(self.joints_rad)), 0, 4095).astype(np.uint16),
            motor_data_type=command.from_motor_data_type,
            which_motors=command.which_motors,
            arrived=sum(1 << int(motor) for motor in asked if int(motor) not in self.silent),
            had_errors=0,
            torque=asked.astype(np.int16),
            misc=misc.astype(np.uint16),
            tactile_data_type=command.tactile_data_type,
            tactile_valid=31,
            tactile=np.arange(80, dtype=np.uint8).reshape(5, 16),
            idle_time_us=400,
        )


class Rig:
    """A hand on a fake palm."""

    def __init__(self, hand_settings: HandSettings = QUICK, motors: MotorMap = MOTORS) -> None:
        self.clock = VirtualClock()
        self.palm = FakePalm(self.clock, motors)
        self.hand = ShadowHand(MemoryTransport("hand", self.palm), self.clock, CALIBRATION, hand_settings, motors)

    def run(self, cycles: int) -> HandSample:
        for _ in range(cycles):
            sample = self.hand.exchange()
            self.clock.sleep_until_ns(self.clock.now_ns() + CYCLE_ns)
        return sample


@pytest.fixture
def rig() -> Iterator[Rig]:
    rig = Rig()
    rig.hand.connect()
    yield rig
    rig.hand.close()


def angle(sample: HandSample, joint: str) -> float:
    return float(sample.joints_rad[JOINT_INDEX[joint]])


# --- lifecycle ---------------------------------------------------------------------------------------------------


def test_connecting_sends_the_all_zero_image_first_and_moves_nothing(rig: Rig) -> None:
    assert palm_codec.encode_command(rig.palm.commands[0]) == bytes(70)
    start_rad = rig.palm.joints_rad.copy()
    rig.run(20)
    assert not any(any(command.motor_data) for command in rig.palm.commands)
    np.testing.assert_array_equal(rig.palm.joints_rad, start_rad)


def test_connecting_twice_and_closing_twice_is_harmless() -> None:
    rig = Rig()
    rig.hand.connect()
    sent = len(rig.palm.commands)
    rig.hand.connect()
    assert len(rig.palm.commands) == sent
    rig.hand.close()
    sent = len(rig.palm.commands)
    rig.hand.close()
    assert len(rig.palm.commands) == sent


def test_a_silent_palm_is_not_connected_and_its_link_is_closed_again() -> None:
    rig = Rig()
    rig.palm.mute = True
    with pytest.raises(DeviceError, match="hand: the palm sent no valid status in 20 cycles"):
        rig.hand.connect()
    with pytest.raises(DeviceError, match="not connected"):
        rig.hand.exchange()
    rig.palm.mute = False
    rig.hand.connect()
    assert rig.run(1).fresh
    rig.hand.close()


def test_closing_sends_zero_demands_for_several_cycles(rig: Rig) -> None:
    rig.hand.set_targets({"FFJ3": 1.2})
    rig.run(5)
    assert any(rig.palm.pwm)
    rig.hand.close()
    assert not any(any(command.motor_data) for command in rig.palm.commands[-5:])
    with pytest.raises(DeviceError, match="not connected"):
        rig.hand.exchange()


def test_a_device_that_fails_while_closing_is_reported_and_still_closed() -> None:
    clock, rig = VirtualClock(), Rig()
    rig.hand.connect()
    recorded = list(_statuses(rig, 1))
    transport = ReplayTransport("hand", [[], *recorded])
    hand = ShadowHand(transport, clock, CALIBRATION, QUICK, MOTORS)
    hand.connect()
    with pytest.raises(DeviceError, match="recording has ended"):
        hand.close()
    hand.close()


# --- motion ------------------------------------------------------------------------------------------------------


@settings(max_examples=15, deadline=None, derandomize=True)
@given(st.lists(st.floats(0.02, 0.98), min_size=20, max_size=20))
def test_every_driven_joint_reaches_its_target(shares: list[float]) -> None:
    rig = Rig()
    rig.hand.connect()
    limits = MOTORS.limits_rad
    targets = {
        name: float(limits[motor, 0] + share * np.ptp(limits[motor]))
        for motor, (name, share) in enumerate(zip(MOTORS.names, shares, strict=True))
    }
    rig.hand.set_targets(targets)
    rig.run(350)
    reached = dict(zip(MOTORS.names, MOTORS.from_joints @ rig.palm.joints_rad, strict=True))
    for name, target in targets.items():
        assert reached[name] == pytest.approx(target, abs=0.01), name
    rig.hand.close()


def test_the_coupled_pair_is_controlled_on_the_sum_of_both_sensors(rig: Rig) -> None:
    rig.hand.set_targets({"FFJ0": 1.1})
    sample = rig.run(200)
    assert angle(sample, "FFJ1") + angle(sample, "FFJ2") == pytest.approx(1.1, abs=0.006)
    assert angle(sample, "FFJ2") - angle(sample, "FFJ1") == pytest.approx(0.1, abs=0.01)  # the split was left alone


def test_targets_are_clamped_to_the_joint_limits(rig: Rig) -> None:
    rig.hand.set_targets({"FFJ0": 9.0, "THJ5": -9.0, "WRJ1": 9.0})
    assert rig.hand.targets_rad == pytest.approx(
        {"FFJ0": np.pi, "THJ5": np.radians(-60), "WRJ1": np.radians(28)}, abs=1e-12
    )


@pytest.mark.parametrize("bad", [{"FFJ1": 0.1}, {"FFJ3": 0.1, "XXJ1": 0.2}, {"FFJ3": float("nan")}])
def test_a_wrong_target_changes_nothing_at_all(rig: Rig, bad: dict[str, float]) -> None:
    rig.hand.set_targets({"MFJ3": 0.5})
    with pytest.raises(DeviceError, match="hand"):
        rig.hand.set_targets(bad)
    assert rig.hand.targets_rad == {"MFJ3": 0.5}


def test_demands_stay_within_each_motors_limit_and_stop_inside_the_dead_band() -> None:
    gains = GainTable(exceptions={"FFJ3": JointGains(pwm_per_rad=1000, deadband_rad=0.05, max_pwm=123)})
    rig = Rig(HandSettings(soft_start_s=0.0, gains=gains))
    rig.hand.connect()
    rig.hand.set_targets({"FFJ3": 1.4, "MFJ3": 1.4})
    rig.run(1)
    assert rig.palm.pwm[MOTORS.numbers["FFJ3"]] == 123
    assert rig.palm.pwm[MOTORS.numbers["MFJ3"]] == 600
    assert Counter(rig.palm.pwm)[0] == 18
    rig.hand.set_targets({"FFJ3": float(rig.palm.joints_rad[JOINT_INDEX["FFJ3"]]) + 0.045})
    rig.run(1)
    assert rig.palm.pwm[MOTORS.numbers["FFJ3"]] == 0
    rig.hand.close()


def test_a_reversed_motor_gets_demands_of_the_other_sign() -> None:
    rig = Rig(motors=MotorMap(MOTORS.numbers, ("FFJ3",)))
    rig.hand.connect()
    rig.hand.set_targets({"FFJ3": 1.0})
    rig.run(1)
    assert rig.palm.pwm[MOTORS.numbers["FFJ3"]] < 0
    assert angle(rig.run(200), "FFJ3") == pytest.approx(1.0, abs=0.006)
    rig.hand.close()


def test_the_first_move_starts_softly() -> None:
    rig = Rig(HandSettings(soft_start_s=0.5))
    rig.hand.connect()
    rig.hand.set_targets({"MFJ3": 1.5})
    strongest = []
    for _ in range(60):
        rig.run(1)
        strongest.append(max(map(abs, rig.palm.pwm)))
    assert strongest[0] == 0
    assert strongest[10] == pytest.approx(120, abs=1)
    assert max(strongest) == 600
    rig.hand.close()


def test_stop_takes_the_demands_away_until_resume_and_forgets_the_targets(rig: Rig) -> None:
    rig.hand.set_targets({"FFJ3": 1.5})
    rig.run(3)
    rig.hand.stop()
    rig.run(5)
    assert not any(any(command.motor_data) for command in rig.palm.commands[-5:])
    rig.hand.resume()
    rig.run(3)
    assert not any(rig.palm.pwm)
    rig.hand.set_targets({"FFJ3": 1.5})
    rig.run(1)
    assert any(rig.palm.pwm)


def test_stop_does_not_raise_on_a_hand_that_was_never_connected() -> None:
    Rig().hand.stop()


# --- what comes back -----------------------------------------------------------------------------------------------


def test_samples_carry_the_calibrated_angles_and_the_tactile_slots(rig: Rig) -> None:
    sample = rig.run(1)
    np.testing.assert_allclose(sample.joints_rad, rig.palm.joints_rad, atol=np.radians(0.3))
    assert sample.fresh
    assert (sample.tactile, sample.tactile_valid, sample.idle_us) == (bytes(range(80)), 31, 400)


def test_motors_are_asked_even_and_odd_in_turn_and_types_change_on_the_step_to_odd(rig: Rig) -> None:
    rig.run(40)
    asked = [(command.which_motors, command.from_motor_data_type) for command in rig.palm.commands[1:]]
    assert [which for which, _ in asked] == [index % 2 for index in range(len(asked))]
    odd_kinds, even_kinds = [kind for _, kind in asked[1::2]], [kind for _, kind in asked[2::2]]
    assert odd_kinds[: len(even_kinds)] == even_kinds


def test_slow_types_are_asked_at_their_period_and_of_both_halves() -> None:
    polling = MotorPolling()
    asked = Counter(polling.next(cycle * CYCLE_ns) for cycle in range(400))
    assert asked[0, FromMotor.TEMPERATURE] == asked[1, FromMotor.TEMPERATURE] == 4
    assert asked[0, FromMotor.VOLTAGE] == asked[1, FromMotor.VOLTAGE] == 2
    assert asked[1, FromMotor.FLAGS] > 50


def test_motor_readings_gather_both_halves_with_their_age(rig: Rig) -> None:
    rig.palm.temperature_C = np.arange(20) + 20
    rig.hand.set_targets({"FFJ3": 1.5})
    sample = rig.run(20)
    assert sample.motor.torque.tolist() == list(range(20))
    assert sample.motor.temperature_C.tolist() == list(range(20, 40))
    assert sample.motor.pwm[MOTORS.numbers["FFJ3"]] == 600
    assert (sample.stamp_ns - sample.motor.stamps_ns[FromMotor.FLAGS]).max() <= 100_000_000
    assert (sample.motor.stamps_ns[FromMotor.D_TERM] < 0).all()
    assert np.isnan(sample.motor.values[FromMotor.D_TERM]).all()


def test_slow_data_are_not_taken_for_a_torque() -> None:
    memory = MotorMemory()
    status = palm_codec.decode_status(bytes(232))
    memory.update(replace(status, motor_data_type=3, arrived=1, torque=np.full(10, 7, np.int16)), 1)
    memory.update(replace(status, motor_data_type=0xA, arrived=1, torque=np.full(10, 6, np.int16)), 2)
    memory.update(replace(status, motor_data_type=0xFFFF, arrived=1, torque=np.full(10, 5, np.int16)), 3)
    readings = memory.readings()
    assert readings.torque[0] == 7
    assert readings.torque_stamps_ns[0] == 1
    assert readings.stamps_ns[FromMotor.SLOW_MISC, 0] == 2


def test_biotacs_are_asked_in_their_rotation_of_fourteen() -> None:
    rig = Rig(HandSettings(tactile="biotac"))
    rig.hand.connect()
    rig.run(27)
    kinds = [command.tactile_data_type for command in rig.palm.commands[1:29]]
    assert kinds == [*BIOTAC_ROTATION] * 2
    assert BIOTAC_ROTATION[:2] == (1, 3)
    assert BIOTAC_ROTATION[2:] == tuple(range(5, 28, 2))
    assert TactileRotation("none").next() == 0
    asking = TactileRotation("biotac", names=True)
    first = [asking.next() for _ in range(2 * 3 * len(TactileQuestion))]
    assert first[0::2] == list((BIOTAC_ROTATION * 2)[: len(first) // 2])
    assert first[1::2] == [*TactileQuestion] * 3
    assert {asking.next() for _ in range(28)} == set(BIOTAC_ROTATION)
    rig.hand.close()


def test_every_command_demands_duty_cycles_from_all_motors(rig: Rig) -> None:
    rig.run(3)
    assert {command.to_motor_data_type for command in rig.palm.commands[1:]} == {ToMotor.DEMAND_PWM}
    assert {command.edc_command for command in rig.palm.commands[1:]} == {1}


# --- losses and faults ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("trouble", ["mute", "unwritten", "frozen"])
def test_a_lost_cycle_repeats_the_last_sample_as_not_fresh(rig: Rig, trouble: str) -> None:
    good = rig.run(1)
    setattr(rig.palm, trouble, True)
    held = rig.run(1)
    assert not held.fresh
    assert held.stamp_ns == good.stamp_ns
    np.testing.assert_array_equal(held.joints_rad, good.joints_rad)
    setattr(rig.palm, trouble, False)
    assert rig.run(1).fresh
    assert rig.hand.counters.lost == 1
    assert any("1 of" in problem for problem in rig.hand.health())


def test_demands_pause_while_the_hand_is_blind_and_return_with_its_status(rig: Rig) -> None:
    rig.hand.set_targets({"FFJ3": 1.5})
    rig.run(2)
    rig.palm.unwritten = True
    demands = []
    for _ in range(4):
        rig.run(1)
        demands.append(any(rig.palm.pwm))
    assert demands == [True, True, False, False]
    rig.palm.unwritten = False
    rig.run(2)
    assert any(rig.palm.pwm)


def test_a_link_that_is_gone_for_longer_than_its_patience_stops_the_hand(rig: Rig) -> None:
    rig.hand.set_targets({"FFJ3": 1.5})
    rig.palm.mute = True
    rig.run(201)
    with pytest.raises(DeviceError, match=r"hand: stopped: no valid status for 2 s\. Check the cable"):
        rig.run(1)
    rig.palm.mute = False
    with pytest.raises(DeviceError, match="no valid status"):
        rig.run(1)
    assert not any(rig.palm.pwm)
    rig.hand.resume()
    assert rig.run(2).fresh


def test_a_link_that_never_comes_back_after_a_resume_stops_the_hand_again(rig: Rig) -> None:
    rig.palm.mute = True
    with pytest.raises(DeviceError, match="no valid status"):
        rig.run(210)
    rig.hand.resume()
    with pytest.raises(DeviceError, match="no valid status"):
        rig.run(210)


def test_a_program_that_stood_still_gives_no_demand_on_an_old_status_and_stops_after_its_patience(rig: Rig) -> None:
    rig.hand.set_targets({"FFJ3": 1.5})
    rig.run(2)
    rig.clock.sleep_until_ns(rig.clock.now_ns() + 60_000_000)
    rig.run(1)
    assert not any(rig.palm.pwm)
    rig.run(1)
    assert any(rig.palm.pwm)
    rig.clock.sleep_until_ns(rig.clock.now_ns() + 2_100_000_000)
    with pytest.raises(DeviceError, match=r"stopped: the program stood still for 2\.1 s"):
        rig.run(1)
    assert not any(rig.palm.pwm)


def test_a_hand_that_is_not_driven_does_not_mind_that_the_program_stood_still(rig: Rig) -> None:
    rig.clock.sleep_until_ns(rig.clock.now_ns() + 60_000_000_000)
    assert rig.run(1).fresh


def test_messages_of_another_kind_count_as_lost_and_show_in_the_health(rig: Rig) -> None:
    rig.palm.garbage = bytes(231)
    assert not rig.run(3).fresh
    rig.palm.garbage = b""
    assert rig.hand.counters.malformed == 3
    assert "3 messages were not a status of a 0220 palm" in rig.hand.health()


@pytest.mark.parametrize(
    ("flag", "words"),
    [
        (MotorFlag.BRIDGE_FAULT, "H-bridge fault"),
        (MotorFlag.EEPROM_CRC_BAD, "stored configuration damaged"),
        (MotorFlag.OVER_TEMPERATURE, "over temperature"),
        (MotorFlag.NO_DEMAND, "no demand for 20 ms"),
    ],
)
def test_a_serious_flag_stops_the_hand_and_names_joint_motor_and_flag(rig: Rig, flag: MotorFlag, words: str) -> None:
    rig.hand.set_targets({"FFJ3": 1.5})
    rig.run(40)
    rig.palm.flags[12] = flag
    with pytest.raises(DeviceError, match=rf"hand, LFJ0 \(motor 12\): stopped: halted, {words}"):
        rig.run(20)
    assert not any(rig.palm.pwm)


@pytest.mark.parametrize(("demand", "stops"), [("pwm", False), ("torque", True)])
def test_a_faulty_strain_gauge_stops_a_hand_whose_motors_keep_torques(
    demand: Literal["pwm", "torque"], stops: bool
) -> None:
    rig = Rig(HandSettings(soft_start_s=0.0, demand=demand))
    rig.hand.connect()
    rig.palm.flags[12] = MotorFlag.GAUGE_LEFT_FAULT
    with pytest.raises(DeviceError, match="left strain gauge faulty") if stops else nullcontext():
        rig.run(20)


def test_motors_that_halted_before_the_demands_began_are_forgiven_at_first_only() -> None:
    rig = Rig()
    rig.palm.flags[:] = MotorFlag.NO_DEMAND
    rig.hand.connect()
    rig.run(20)
    with pytest.raises(DeviceError, match="no demand for 20 ms"):
        rig.run(40)
    rig.hand.close()


@pytest.mark.parametrize(("way_ms", "forgiven"), [(12, True), (8, False)])
def test_a_pause_of_the_host_and_one_of_the_wire_that_add_up_let_motors_report_that_they_had_halted(
    rig: Rig, way_ms: int, forgiven: bool
) -> None:
    rig.run(40)
    rig.palm.delay_ns = way_ms * 1_000_000
    rig.run(1)  # 10 ms after the command before it
    rig.palm.delay_ns = 0
    rig.palm.flags[:] = MotorFlag.NO_DEMAND
    with nullcontext() if forgiven else pytest.raises(DeviceError, match="no demand for 20 ms"):
        rig.run(8)


def test_a_pause_of_the_host_lets_motors_report_that_they_had_halted(rig: Rig) -> None:
    rig.run(40)
    rig.clock.sleep_until_ns(rig.clock.now_ns() + 500_000_000)
    rig.palm.flags[:] = MotorFlag.NO_DEMAND
    rig.run(15)
    rig.palm.flags[:] = 0
    rig.run(40)


def test_harmless_flags_show_in_the_health_only(rig: Rig) -> None:
    rig.palm.flags[3] = MotorFlag.JIGGLING
    rig.run(30)
    assert "hand, MFJ0 (motor 3): zeroing its strain gauges, not controlled" in rig.hand.health()


def test_a_warm_motor_gets_half_its_limit_and_a_hot_one_stops_the_hand(rig: Rig) -> None:
    motor = MOTORS.numbers["MFJ3"]
    rig.palm.temperature_C[motor] = 51
    rig.run(10)
    rig.hand.set_targets({"MFJ3": 1.5, "FFJ3": 1.5})
    rig.run(1)
    assert rig.palm.pwm[motor] == 300
    assert rig.palm.pwm[MOTORS.numbers["FFJ3"]] == 600
    assert any("MFJ3 (motor 11): warm, 51 C" in problem for problem in rig.hand.health())
    rig.palm.temperature_C[motor] = 55
    with pytest.raises(DeviceError, match=r"MFJ3 \(motor 11\): stopped: 55 C, limit 55 C"):
        rig.run(120)


def test_a_silent_motor_is_named_in_the_health(rig: Rig) -> None:
    rig.palm.silent = {19}
    rig.run(60)
    assert rig.hand.health() == ("hand, THJ5 (motor 19): silent",)


def test_a_sound_hand_has_nothing_to_report(rig: Rig) -> None:
    rig.run(60)
    assert rig.hand.health() == ()


# --- replay ----------------------------------------------------------------------------------------------------------


def _statuses(rig: Rig, cycles: int) -> Iterator[Datagram]:
    for cycle in range(cycles):
        rig.palm.joints_rad[JOINT_INDEX["FFJ3"]] = 0.4 + 0.01 * cycle
        rig.palm.write(palm_codec.encode_command(PalmCommand(1, 3 + cycle // 2 % 2, cycle % 2)))
        yield from rig.palm.read()


def test_a_decoder_gives_the_same_samples_from_the_same_bytes() -> None:
    datagrams = list(_statuses(Rig(), 30))
    runs = [[HandDecoder(CALIBRATION)] * len(datagrams) for _ in range(2)]
    first, second = ([d.receive(each) for d, each in zip(run, datagrams, strict=True)] for run in runs)
    for a, b in zip(first, second, strict=True):
        assert (a is None) == (b is None)
        if a is not None and b is not None:
            assert a.joints_rad.tobytes() == b.joints_rad.tobytes()
            assert a.motor.values.tobytes() == b.motor.values.tobytes()


def test_a_decoder_refuses_bytes_of_another_protocol() -> None:
    with pytest.raises(CodecError, match="231 bytes instead of 232"):
        HandDecoder(CALIBRATION).receive(Datagram(bytes(231), 0))


@settings(max_examples=40, deadline=None, derandomize=True)
@given(st.lists(st.binary(min_size=232, max_size=232), max_size=5))
def test_any_bytes_of_the_right_length_are_taken_without_failing(payloads: list[bytes]) -> None:
    decoder = HandDecoder(CALIBRATION)
    for payload in payloads:
        sample = decoder.receive(Datagram((1).to_bytes(4, "little") + payload[4:], 5))
        assert sample is None or np.isfinite(sample.joints_rad).all()
