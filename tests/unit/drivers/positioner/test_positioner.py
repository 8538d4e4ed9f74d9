from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from gtsam import Pose3, Rot3
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from drivers.core.clock import VirtualClock
from drivers.core.contacts import Array
from drivers.core.errors import CodecError, DeviceError
from drivers.core.transports import Datagram, MemoryTransport, ReplayTransport
from drivers.positioner.codec import (
    LARGEST_SEQUENCE,
    PositionerCodec,
    PositionerCommand,
    PositionerStatus,
    decode_command,
    decode_status,
    encode_command,
    encode_status,
)
from drivers.positioner.positioner import (
    Positioner,
    PositionerSample,
    PositionerSettings,
    mount_joints,
    mount_T_forearm,
)

CYCLE_ns = 10_000_000
quick = settings(max_examples=60, deadline=None, derandomize=True)
angle = st.floats(-np.pi, np.pi)
axes = st.tuples(*[st.floats(-1, 1)] * 3, angle, st.floats(-1.57, 1.57), st.floats(-3.14, 3.14)).map(np.array)
number = st.floats(allow_nan=False)


class FakeBase:
    """Takes commands and is there at once; a wall can stop its x axis."""

    def __init__(self, clock: VirtualClock) -> None:
        self.clock = clock
        self.q: Array = np.array([0.1, 0.0, 0.4, 0.0, 0.5, 0.0])
        self.commands: list[PositionerCommand] = []
        self.mute = self.frozen = self.slow = False
        self.wall_x_m = 9.0
        self.garbage = b""
        self._waiting: list[Datagram] = []

    def write(self, payload: bytes) -> None:
        command = decode_command(payload)
        self.commands.append(command)
        if command.targets is not None:
            self.q = command.targets.copy()
            self.q[0] = min(self.q[0], self.wall_x_m)
        sequence = 7 if self.frozen else command.sequence
        if not self.mute:
            answer = self.garbage or encode_status(PositionerStatus(sequence, self.q))
            self._waiting.append(Datagram(answer, self.clock.now_ns()))

    def read(self) -> list[Datagram]:
        if self.slow:
            return []
        waiting, self._waiting = self._waiting, []
        return waiting


class Rig:
    def __init__(self, base_settings: PositionerSettings | None = None) -> None:
        self.clock = VirtualClock()
        self.base = FakeBase(self.clock)
        self.device = Positioner(MemoryTransport("base", self.base), self.clock, base_settings)

    def run(self, cycles: int) -> PositionerSample:
        for _ in range(cycles):
            self.clock.sleep_until_ns(self.clock.now_ns() + CYCLE_ns)
            sample = self.device.exchange()
        return sample


def along_x(q: Array, distance_m: float) -> Array:
    return np.array([q[0] + distance_m, *q[1:]])


@pytest.fixture
def rig() -> Iterator[Rig]:
    rig = Rig()
    rig.device.connect()
    yield rig
    rig.device.close()


# --- kinematics ----------------------------------------------------------------------------------------------------


def test_at_zero_the_palm_faces_down_and_the_fingers_point_along_x() -> None:
    rotation = mount_T_forearm(np.zeros(6)).rotation().matrix()
    np.testing.assert_allclose(rotation @ [0, 0, 1], [1, 0, 0], atol=1e-15)  # z runs along the fingers
    np.testing.assert_allclose(rotation @ [0, -1, 0], [0, 0, -1], atol=1e-15)  # -y leaves the palm


def test_axes_act_in_the_order_yaw_pitch_roll() -> None:
    q = np.array([0.1, -0.2, 0.3, 0.7, 0.4, -0.5])
    zero = mount_T_forearm(np.zeros(6))
    expected = Pose3(Rot3.Rz(0.7) * Rot3.Ry(0.4) * Rot3.Rx(-0.5), q[:3]) * zero
    np.testing.assert_allclose(mount_T_forearm(q).matrix(), expected.matrix(), atol=1e-12)


@quick
@given(q=axes)
def test_joints_come_back_from_the_pose(q: Array) -> None:
    np.testing.assert_allclose(mount_joints(mount_T_forearm(q), near_yaw=float(q[3])), q, atol=1e-6)


@quick
@given(q=axes, turns=st.integers(-3, 3), off=st.floats(-3.0, 3.0))
def test_the_yaw_nearest_to_the_wish_is_taken(q: Array, turns: int, off: float) -> None:
    near_yaw = float(q[3]) + turns * 2 * np.pi + off
    found = mount_joints(mount_T_forearm(q), near_yaw)
    assert found[3] == pytest.approx(q[3] + turns * 2 * np.pi, abs=1e-6)


@quick
@given(yaw=angle, roll=angle, near_yaw=angle, up=st.sampled_from([-1, 1]))
def test_upright_poses_keep_the_yaw_and_are_reached_exactly(yaw: float, roll: float, near_yaw: float, up: int) -> None:
    pose = mount_T_forearm(np.array([0, 0, 0, yaw, up * np.pi / 2, roll]))
    found = mount_joints(pose, near_yaw)
    assert found[3] == pytest.approx(near_yaw)
    np.testing.assert_allclose(mount_T_forearm(found).matrix(), pose.matrix(), atol=1e-8)


@quick
@given(rotation=st.tuples(angle, angle, angle), near_yaw=st.floats(-10, 10))
def test_every_orientation_can_be_reached(rotation: tuple[float, float, float], near_yaw: float) -> None:
    pose = Pose3(Rot3.Expmap(np.array(rotation)), np.array([0.1, 0.2, 0.3]))
    found = mount_joints(pose, near_yaw)
    np.testing.assert_allclose(mount_T_forearm(found).matrix(), pose.matrix(), atol=1e-8)
    assert abs(found[4]) <= np.pi / 2


# --- codec ---------------------------------------------------------------------------------------------------------


@quick
@given(sequence=st.integers(1, 0xFFFFFFFF), values=st.lists(number, min_size=6, max_size=6))
def test_commands_and_statuses_survive_the_wire(sequence: int, values: list[float]) -> None:
    command = decode_command(encode_command(PositionerCommand(sequence, np.array(values))))
    status = decode_status(encode_status(PositionerStatus(sequence, np.array(values))))
    assert command.targets is not None
    assert (command.sequence, command.targets.tolist()) == (sequence, values)
    assert (status.sequence, status.q.tolist()) == (sequence, values)


@quick
@given(payload=st.binary(min_size=52, max_size=52))
def test_every_52_bytes_are_a_status_and_a_command(payload: bytes) -> None:
    status = decode_status(payload)
    np.testing.assert_array_equal(decode_status(encode_status(status)).q, status.q)
    assert decode_command(payload).sequence == struct.unpack_from("<I", payload)[0]


@quick
@given(payload=st.binary(max_size=80).filter(lambda payload: len(payload) != 52))
def test_any_other_length_is_refused(payload: bytes) -> None:
    for decode in (decode_command, decode_status):
        with pytest.raises(CodecError, match=f"{len(payload)} bytes instead of 52"):
            decode(payload)


def test_a_question_carries_no_targets() -> None:
    assert encode_command(PositionerCommand(0, None)) == bytes(52)
    assert decode_command(bytes(52)).targets is None
    for wrong in (PositionerCommand(0, np.zeros(6)), PositionerCommand(1, None)):
        with pytest.raises(CodecError, match="a request for the position has sequence number 0"):
            encode_command(wrong)
    with pytest.raises(CodecError, match="does not fit"):
        encode_command(PositionerCommand(1, np.zeros(5)))


# --- device --------------------------------------------------------------------------------------------------------


def test_connecting_asks_and_moves_nothing(rig: Rig) -> None:
    start = rig.base.q.copy()
    assert rig.base.commands[0].targets is None
    sample = rig.run(5)
    np.testing.assert_array_equal(rig.base.q, start)
    np.testing.assert_array_equal(sample.q, start)


def test_a_silent_positioner_is_not_connected() -> None:
    rig = Rig()
    rig.base.mute = True
    with pytest.raises(DeviceError, match="base: no answer to 20 requests"):
        rig.device.connect()
    with pytest.raises(DeviceError, match="not connected"):
        rig.device.exchange()
    rig.base.mute = False
    rig.device.connect()
    rig.device.connect()
    assert rig.run(1).fresh
    rig.device.close()
    rig.device.close()


def test_a_jump_of_the_target_becomes_a_straight_ramp_within_the_speed_limits(rig: Rig) -> None:
    start, target = rig.base.q.copy(), np.array([0.3, -0.1, 0.2, 2.0, 0.0, -0.3])
    rig.device.set_target(target)
    rig.run(200)
    path = np.array([command.targets for command in rig.base.commands if command.targets is not None])
    steps = np.abs(np.diff(np.vstack([start, path]), axis=0))
    assert steps[:, :3].max() <= 0.5 * 0.01 + 1e-9
    assert steps[:, 3:].max() <= 2.5 * 0.01 + 1e-9
    shares = (path - start) / (target - start)
    np.testing.assert_allclose(shares - shares[:, :1], 0.0, atol=1e-9)
    np.testing.assert_array_equal(rig.base.q, target)


def test_a_pause_of_the_host_does_not_make_a_long_step(rig: Rig) -> None:
    start = rig.base.q.copy()
    rig.device.set_target(along_x(start, 0.5))
    rig.clock.sleep_until_ns(rig.clock.now_ns() + 3_000_000_000)
    rig.device.exchange()
    assert rig.base.q[0] - start[0] <= 0.5 * 0.05 + 1e-9


def test_targets_are_clamped_to_the_ranges(rig: Rig) -> None:
    rig.device.set_target(np.array([1.0005, 0.0, -0.3005, 0.0, 0.5, 0.0]))
    rig.run(400)
    np.testing.assert_allclose(rig.base.q[[0, 2]], [1.0, -0.3])


@pytest.mark.parametrize(("axis", "value", "words"), [(0, 1.1, "x was sent to 1.10"), (3, -13.0, "yaw was sent to")])
def test_a_target_beyond_a_range_is_refused_and_the_positioner_stays(
    rig: Rig, axis: int, value: float, words: str
) -> None:
    start = rig.base.q.copy()
    target = start.copy()
    target[axis] = value
    with pytest.raises(DeviceError, match=words):
        rig.device.set_target(target)
    rig.run(20)
    np.testing.assert_allclose(rig.base.q, start)


def test_an_axis_that_stands_beyond_its_range_may_come_back(rig: Rig) -> None:
    rig.base.q[3] = 13.0
    rig.device.close()
    rig.device.connect()
    target = rig.base.q.copy()
    target[3] = 12.9
    rig.device.set_target(target)
    rig.run(400)
    assert rig.base.q[3] == pytest.approx(12.5)


@pytest.mark.parametrize("bad", [np.zeros(5), np.array([0, 0, np.nan, 0, 0, 0]), np.array([0, 0, np.inf, 0, 0, 0])])
def test_a_target_that_is_not_six_numbers_is_refused(rig: Rig, bad: Array) -> None:
    with pytest.raises(DeviceError, match="not six finite numbers"):
        rig.device.set_target(bad)


def test_stop_holds_the_position_until_resume(rig: Rig) -> None:
    rig.device.set_target(along_x(rig.base.q, 0.5))
    rig.run(10)
    rig.device.stop()
    here = rig.base.q.copy()
    rig.device.set_target(np.zeros(6))
    rig.run(10)
    np.testing.assert_array_equal(rig.base.q, here)
    rig.device.resume()
    rig.run(10)
    np.testing.assert_array_equal(rig.base.q, here)
    rig.device.set_target(along_x(here, 0.1))
    rig.run(50)
    assert rig.base.q[0] == pytest.approx(here[0] + 0.1)


@pytest.mark.parametrize("trouble", ["mute", "frozen"])
def test_while_no_status_comes_the_ramp_waits(rig: Rig, trouble: str) -> None:
    rig.device.set_target(along_x(rig.base.q, 0.5))
    rig.run(5)
    setattr(rig.base, trouble, True)
    rig.run(2)
    here = rig.base.q.copy()
    assert not rig.run(4).fresh
    np.testing.assert_array_equal(rig.base.q, here)
    setattr(rig.base, trouble, False)
    assert rig.run(3).fresh
    assert rig.base.q[0] > here[0]
    assert any("cycles lost" in problem for problem in rig.device.health())


def test_a_status_that_takes_up_to_a_cycle_is_not_lost_and_one_that_never_comes_is(rig: Rig) -> None:
    for slow in (False, True, False, True, False, False):
        rig.base.slow = slow
        rig.run(1)
    assert rig.device.counters.lost == 0
    rig.base.mute = True
    rig.run(2)
    rig.base.mute = False
    rig.run(2)
    assert rig.device.counters.lost == 2


def test_ten_lost_cycles_stop_the_positioner_and_the_tenth_says_so(rig: Rig) -> None:
    rig.base.mute = True
    rig.run(10)  # the first answer may be on its way
    with pytest.raises(DeviceError, match="base: stopped after 10 cycles in a row without a status"):
        rig.run(1)
    rig.base.mute = False
    rig.device.resume()
    assert rig.run(1).fresh


def test_an_axis_that_does_not_follow_stops_the_positioner_where_it_stands(rig: Rig) -> None:
    rig.base.wall_x_m = 0.2
    rig.device.set_target(along_x(rig.base.q, 0.6))
    with pytest.raises(DeviceError, match="base: stopped: x does not follow"):
        rig.run(100)
    assert rig.base.commands[-1].targets is not None
    assert rig.base.commands[-1].targets[0] == pytest.approx(0.2)
    assert "x does not follow" in rig.device.health()[0]


@pytest.mark.parametrize("garbage", [bytes(51), encode_status(PositionerStatus(3, np.full(6, np.nan)))])
def test_bytes_that_are_no_status_count_as_lost(rig: Rig, garbage: bytes) -> None:
    rig.base.garbage = garbage
    assert not rig.run(2).fresh
    assert rig.device.counters.malformed == 2
    assert "2 messages were not a positioner status" in rig.device.health()


@pytest.mark.parametrize("q", [np.zeros(5), np.zeros((6, 1)), np.zeros(0)])
def test_another_codec_may_not_give_another_number_of_axes(q: Array) -> None:
    """As an extension's may: it would be seen only where the positions are used, far from its file."""
    clock = VirtualClock()
    codec = PositionerCodec(
        encode_command, decode_command, encode_status, lambda payload: replace(decode_status(payload), q=q)
    )
    device = Positioner(MemoryTransport("base", FakeBase(clock)), clock, codec=codec)
    with pytest.raises(CodecError, match="base: a status without six finite positions"):
        device.receive(Datagram(encode_status(PositionerStatus(3, np.zeros(6))), 0))
    with pytest.raises(DeviceError, match="base: no answer to"):
        device.connect()


def test_a_sound_positioner_has_nothing_to_report(rig: Rig) -> None:
    before = rig.device.counters.cycles  # connecting may take an exchange or two
    rig.run(30)
    assert rig.device.health() == ()
    counters = rig.device.counters
    assert 0 <= before <= 2
    assert counters.cycles == before + 30
    assert (counters.lost, counters.lost_in_a_row, counters.malformed, counters.late) == (0, 0, 0, 0)


def test_stop_does_not_raise_before_connecting() -> None:
    Rig().device.stop()


def test_an_empty_range_is_refused() -> None:
    ranges = (*PositionerSettings().ranges[:2], (1.0, 0.0), *PositionerSettings().ranges[3:])
    with pytest.raises(ValidationError, match="range of z is empty"):
        PositionerSettings(ranges=ranges)


def test_a_status_that_comes_behind_a_newer_one_is_not_taken_for_the_newest() -> None:
    device = Positioner(ReplayTransport("base", ()), VirtualClock())
    told = [encode_status(PositionerStatus(sequence, np.full(6, sequence / 100.0))) for sequence in (7, 9, 8, 9, 10)]
    samples = [device.receive(Datagram(payload, 0)) for payload in told]
    assert [None if sample is None else round(100 * sample.q[0]) for sample in samples] == [7, 9, None, None, 10]
    assert device.counters.late == 1
    assert "1 statuses arrived after newer ones" in device.health()


def test_sequences_go_on_after_their_largest() -> None:
    device = Positioner(ReplayTransport("base", ()), VirtualClock())
    for sequence in (LARGEST_SEQUENCE - 1, LARGEST_SEQUENCE, 1, 2):
        assert device.receive(Datagram(encode_status(PositionerStatus(sequence, np.zeros(6))), 0)) is not None
    assert device.counters.late == 0
