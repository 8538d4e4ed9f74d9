"""The Nano17 fingertip: stream, tare, weight, contact, and everything that can be wrong with it."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from gtsam import Rot3

from drivers.ati.nano17 import Nano17, Nano17Settings
from drivers.ati.protocols import rdt_codec
from drivers.ati.protocols.rdt_codec import Command
from drivers.core.clock import VirtualClock
from drivers.core.contacts import FINGERS, Array
from drivers.core.errors import CodecError, ConfigurationError, DeviceError
from drivers.core.fingertip import GRAVITY, FingertipCalibration, load_fingertips
from drivers.core.transports import Datagram, ReplayTransport
from drivers.force.force_fingertip import ForceTipSettings, WrenchSample
from drivers.force.intrinsic_contact import wrench_transform
from drivers.force.sequences import SequenceMonitor
from tests.support.repository import SIMULATED_HAND

TIPS = SIMULATED_HAND / "fingertips.yaml"
BIAS = np.array([0.3, -0.2, 1.1, 0.004, -0.002, 0.001])


@pytest.fixture
def calibration() -> FingertipCalibration:
    """With a hard skin: what is pressed here is where the ellipsoid ends."""
    return load_fingertips(TIPS)["FF"].model_copy(update={"yield_m": 0.0})


@pytest.fixture
def tip(calibration: FingertipCalibration) -> Nano17:
    return Nano17("FF", ReplayTransport("ft/FF", []), VirtualClock(), calibration, Nano17Settings())


def weight(calibration: FingertipCalibration, world_R_distal: Array) -> Array:
    force = world_R_distal.T @ np.array([0, 0, -calibration.mass_kg * GRAVITY])
    lever = np.array(calibration.com_distal_m) - np.array(calibration.distal_T_sensor.translation_m)
    return np.concatenate([force, np.cross(lever, force)])


def pressed(calibration: FingertipCalibration, direction: Array, force_N: Array) -> tuple[Array, Array, Array]:
    """Contact point and outward normal in the distal frame, and the wrench in the sensor frame."""
    axes = np.array(calibration.semi_axes_m)
    from_centre = direction / np.linalg.norm(direction / axes)
    normal = from_centre / axes**2 / np.linalg.norm(from_centre / axes**2)
    point = from_centre + np.array(calibration.centre_distal_m)
    lever = point - np.array(calibration.distal_T_sensor.translation_m)
    return point, normal, np.concatenate([force_N, np.cross(lever, force_N)])


class Stream:
    """Gives a tip samples with running counters."""

    def __init__(self, tip: Nano17, rng: np.random.Generator | None = None) -> None:
        self.tip, self.count, self._rng = tip, 0, rng or np.random.default_rng(0)

    def feed(self, wrench: Array, n: int = 20, *, status: int = 0, noise: float = 1.0, stuck: bool = False) -> None:
        scale = noise * np.repeat([1 / 320, 1e-3 / 64], 3)
        for _ in range(n):
            self.count += 1
            ft = 7 if stuck else 70 * self.count
            reading = wrench + scale * self._rng.normal(size=6)
            faults, remarks = rdt_codec.judge_status(status)
            self.tip.update([WrenchSample(10_000_000 * self.count, reading, self.count, ft, status, faults, remarks)])


def test_the_shipped_calibration_has_all_five_fingers() -> None:
    tips = load_fingertips(TIPS)
    assert set(tips) == set(FINGERS)
    assert tips["TH"].semi_axes_m == (0.0085, 0.0085, 0.013)
    np.testing.assert_allclose(tips["TH"].distal_T_sensor.pose().translation(), [0, 0, 0.004])


def test_an_unknown_finger_or_a_flat_tip_is_refused(tmp_path: Path) -> None:
    tip = load_fingertips(TIPS)["MF"].model_dump(mode="json")
    (tmp_path / "tips.yaml").write_text(json.dumps({"fingertips": {"XX": tip}}))
    with pytest.raises(ConfigurationError, match="XX"):
        load_fingertips(tmp_path / "tips.yaml")
    flat = {"fingertips": {"MF": tip | {"semi_axes_m": [0.0085, 0.0085, 0.0]}}}
    (tmp_path / "tips.yaml").write_text(json.dumps(flat))
    with pytest.raises(ConfigurationError, match="semi_axes_m"):
        load_fingertips(tmp_path / "tips.yaml")


def test_connecting_stops_an_old_stream_and_starts_ours_and_closing_stops_it(calibration: FingertipCalibration) -> None:
    class Watched(ReplayTransport):
        turns = ""

        def open(self) -> None:
            self.turns += "opened "

        def close(self) -> None:
            self.turns += "closed "

    transport = Watched("ft/FF", [])
    tip = Nano17("FF", transport, VirtualClock(), calibration, Nano17Settings())
    tip.connect()
    tip.connect()
    assert transport.turns == "opened "
    tip.close()
    tip.close()
    assert transport.turns == "opened closed "
    assert [rdt_codec.decode_request(request).command for request in transport.sent] == [
        Command.STOP,
        Command.START,
        Command.STOP,
    ]


def test_a_failed_connect_leaves_the_link_closed(calibration: FingertipCalibration) -> None:
    class Dead(ReplayTransport):
        closed = False

        def send(self, payload: bytes) -> None:
            raise DeviceError("gone", where=self.name)

        def close(self) -> None:
            self.closed = True

    transport = Dead("ft/FF", [])
    tip = Nano17("FF", transport, VirtualClock(), calibration, Nano17Settings())
    with pytest.raises(DeviceError, match="gone"):
        tip.connect()
    assert transport.closed
    tip.close()


def test_poll_decodes_all_that_waits_and_counts_foreign_datagrams(calibration: FingertipCalibration) -> None:
    counts = np.array([[1_500_000, -250_000, 3_000_000, 12_000, -500, 0]])
    batch = [
        Datagram(rdt_codec.encode_records(np.array([n]), np.array([7 * n]), np.zeros(1), counts), 1000 * n)
        for n in range(1, 4)
    ]
    transport = ReplayTransport("ft/FF", [[batch[0], Datagram(b"hello", 1), *batch[1:]]])
    tip = Nano17("FF", transport, VirtualClock(), calibration, Nano17Settings())
    samples = tip.poll()
    assert [(s.stamp_ns, s.sent, s.measured) for s in samples] == [
        (1000, 1, 7),
        (2000, 2, 14),
        (3000, 3, 21),
    ]
    np.testing.assert_allclose(samples[0].wrench, [1.5, -0.25, 3, 0.012, -0.0005, 0])
    assert any("not from this sensor" in problem for problem in tip.health())
    with pytest.raises(CodecError):
        tip.receive(Datagram(b"hello", 1))


def test_the_tare_removes_bias_and_the_weight_follows_the_tip(tip: Nano17, calibration: FingertipCalibration) -> None:
    stream, down, tilted = Stream(tip), np.eye(3), Rot3.RzRyRx(1.2, -0.4, 2.0).matrix()
    stream.feed(BIAS + weight(calibration, down))
    tip.tare(down, reason="before the session")
    assert tip.load_N(down) < 0.02
    stream.feed(BIAS + weight(calibration, tilted))
    assert tip.load_N(tilted) < 0.02
    assert tip.load_N(down) > 0.05  # without the right orientation the tip's own weight looks like a contact
    assert tip.tare_record is not None
    assert (tip.tare_record.reason, tip.tare_record.stamp_ns) == ("before the session", 200_000_000)
    np.testing.assert_allclose(tip.tare_record.bias, BIAS, atol=4e-3)


@pytest.mark.parametrize("direction", [[0, -1, 0.3], [0.2, -1, 0], [0.1, -0.3, 1], [1, 0.2, 0.1]])
def test_a_contact_is_found_within_its_own_covariance(
    tip: Nano17, calibration: FingertipCalibration, direction: list[float]
) -> None:
    stream, orientation = Stream(tip), Rot3.RzRyRx(0.5, 0.3, -0.8).matrix()
    stream.feed(BIAS + weight(calibration, orientation))
    tip.tare(orientation)
    _, normal, _ = pressed(calibration, np.array(direction), np.zeros(3))
    force = -0.6 * normal + 0.2 * np.cross(normal, [0.3, 0.2, 0.9])
    point, normal, wrench = pressed(calibration, np.array(direction), force)
    wrench[3:] -= 0.0004 * normal
    tip.begin_capture()
    stream.feed(BIAS + weight(calibration, orientation) + wrench)
    contact = tip.contact(orientation)
    assert contact is not None
    error = contact.point_distal_m - point
    assert np.linalg.norm(error) < 0.0015
    assert error @ np.linalg.solve(contact.point_covariance_m2, error) < 11.3  # 99 % of a chi-square of three
    assert math.acos(contact.normal_distal @ -normal) < 3 * contact.normal_sigma_rad
    assert contact.force_N == pytest.approx(np.linalg.norm(force), abs=0.01)
    assert contact.torsion_Nm == pytest.approx(0.0004, abs=1e-4)


def test_the_covariance_tells_the_error_that_drift_makes(calibration: FingertipCalibration) -> None:
    """Over many sessions the squared error, in units of the covariance, averages three (one for each axis)."""
    rng, scores = np.random.default_rng(4), []
    for _ in range(150):
        tip = Nano17("FF", ReplayTransport("ft", []), VirtualClock(), calibration, Nano17Settings())
        direction = rng.normal(size=3) * [1, 1, 0.5] + [0, -1, 0.5]
        _, normal, _ = pressed(calibration, direction, np.zeros(3))
        point, _, wrench = pressed(calibration, direction, -0.4 * normal + 0.15 * rng.normal(size=3))
        drift = rng.normal(size=6) * np.repeat([calibration.force_drift_N, calibration.moment_drift_Nm], 3)
        stream = Stream(tip, rng)
        stream.feed(weight(calibration, np.eye(3)))
        tip.tare(np.eye(3))
        tip.begin_capture()
        stream.feed(weight(calibration, np.eye(3)) + wrench + drift)
        if (contact := tip.contact(np.eye(3))) is not None:
            error = contact.point_distal_m + calibration.point_floor_m * rng.normal(size=3) - point
            scores.append(error @ np.linalg.solve(contact.point_covariance_m2, error))
    assert len(scores) > 140
    assert 2.4 < np.mean(scores) < 3.6


def test_too_little_force_or_too_few_samples_give_no_contact(tip: Nano17, calibration: FingertipCalibration) -> None:
    stream, still = Stream(tip), weight(calibration, np.eye(3))
    stream.feed(still)
    tip.tare(np.eye(3))
    _, _, wrench = pressed(calibration, np.array([0, -1.0, 0]), np.array([0, 0.05, 0]))
    tip.begin_capture()
    stream.feed(still + wrench)
    assert tip.contact(np.eye(3)) is None
    tip.begin_capture()
    stream.feed(still + 10 * wrench, n=2)
    assert tip.contact(np.eye(3)) is None
    stream.feed(still + 10 * wrench, n=1)
    assert tip.contact(np.eye(3)) is not None


def test_a_contact_where_the_shell_ends_is_not_reported(calibration: FingertipCalibration) -> None:
    palmar = calibration.model_copy(update={"shell_max_distal_m": (1.0, 0.0051, 1.0), "mass_kg": 0.0})
    tip = Nano17("FF", ReplayTransport("ft", []), VirtualClock(), palmar, Nano17Settings())
    for y, found in ((-1.0, True), (1.0, False)):
        _, _, wrench = pressed(palmar, np.array([0, y, 0.2]), np.array([0, -y, 0]))
        tip.begin_capture()
        Stream(tip).feed(wrench)
        tip.sequences = SequenceMonitor()
        assert (tip.contact(np.eye(3)) is not None) is found


def test_a_tare_is_refused_while_the_hand_moves_or_samples_are_missing(tip: Nano17) -> None:
    stream = Stream(tip)
    stream.feed(BIAS, n=5)
    with pytest.raises(DeviceError, match="5 usable samples"):
        tip.tare(np.eye(3))
    stream.feed(BIAS, n=20)
    tip.tare(np.eye(3))
    kept = tip.tare_record
    stream.feed(BIAS + np.array([0.2, 0, 0, 0, 0, 0]), n=10)
    with pytest.raises(DeviceError, match="Hold the hand still"):
        tip.tare(np.eye(3))
    assert tip.tare_record is kept


def test_void_samples_stop_motion_and_never_reach_a_contact(tip: Nano17, calibration: FingertipCalibration) -> None:
    stream = Stream(tip)
    stream.feed(np.zeros(6))
    assert "not tared" in tip.health()
    tip.tare(np.eye(3))
    tip.begin_capture()
    stream.feed(np.full(6, 0.05), status=0x80020000)
    assert tip.load_N(np.eye(3)) == math.inf
    assert tip.void() == "sensor saturated or disconnected"
    assert tip.contact(np.eye(3)) is None
    assert "sensor saturated or disconnected" in tip.health()
    stream.feed(np.array([0, 0, 18.0, 0, 0, 0]), n=1)
    assert tip.load_N(np.eye(3)) == math.inf
    assert tip.void() == "Fz at 106 % of the calibration range"
    assert "reading beyond the calibration range" in tip.health()
    assert "21 invalid samples ignored" in tip.health()
    with pytest.raises(DeviceError, match="0 usable samples"):
        tip.tare(np.eye(3))


def test_a_warning_of_the_box_is_shown_but_the_reading_is_used(tip: Nano17) -> None:
    Stream(tip).feed(np.zeros(6), status=0x80010000)
    assert math.isfinite(tip.load_N(np.eye(3)))
    assert "a monitor condition is latched" in tip.health()


def test_a_stuck_sensor_loop_is_noticed(tip: Nano17) -> None:
    stream = Stream(tip)
    stream.feed(np.zeros(6), stuck=True)
    assert any("stopped measuring" in problem for problem in tip.health())
    assert tip.load_N(np.eye(3)) == math.inf
    assert "stopped measuring" in tip.void()
    stream.feed(np.zeros(6), n=1)
    assert math.isfinite(tip.load_N(np.eye(3)))
    assert tip.void() == ""


def test_silence_is_noticed_by_the_clock(calibration: FingertipCalibration) -> None:
    clock = VirtualClock()
    tip = Nano17("FF", ReplayTransport("ft/FF", []), clock, calibration, Nano17Settings())
    assert tip.load_N(np.eye(3)) == 0.0
    assert tip.health() == ("no sample received yet", "not tared")
    tip.update([WrenchSample(clock.now_ns(), np.zeros(6), 1, 7)])
    assert tip.health() == ("not tared",)
    clock.sleep_until_ns(150_000_000)
    assert "no record for 150 ms" in tip.health()


def test_losses_disorder_and_restarts_are_counted() -> None:
    monitor = SequenceMonitor()
    taken = [monitor.is_new(rdt, 7 * rdt) for rdt in (1, 2, 5, 4, 5, 6)]
    assert taken == [True, True, True, False, False, True]
    assert (monitor.lost, monitor.disordered, monitor.restarts, monitor.seen) == (2, 2, 0, 4)
    assert monitor.is_new(1, 700)  # the box counts sent records from one again, measured ones go on
    assert monitor.restarts == 1


def test_a_box_that_was_switched_off_and_on_is_followed_again() -> None:
    """Both counters begin again: the first records look old, but not for ever."""
    monitor = SequenceMonitor()
    assert all(monitor.is_new(5000 + n, 7 * (5000 + n)) for n in range(20))
    taken = [monitor.is_new(n, 7 * n) for n in range(1, 31)]
    assert taken == [False] * 9 + [True] * 21
    assert (monitor.restarts, monitor.disordered, monitor.lost) == (1, 10, 0)


def test_what_the_box_should_have_sent_and_did_not_is_counted() -> None:
    monitor = SequenceMonitor(step=7)
    for rdt, ft in ((1, 7), (2, 14), (3, 35), (4, 42), (6, 56)):  # two left out by the box, one lost on the way
        assert monitor.is_new(rdt, ft)
    assert (monitor.skipped, monitor.lost) == (2, 1)


def test_the_counters_may_wrap() -> None:
    monitor = SequenceMonitor()
    assert all(monitor.is_new(n % 2**32, n % 2**32) for n in range(2**32 - 2, 2**32 + 3))
    assert (monitor.lost, monitor.restarts, monitor.disordered) == (0, 0, 0)


def test_many_losses_are_a_problem(tip: Nano17) -> None:
    tip.update([WrenchSample(n, np.zeros(6), n, 7 * n) for n in range(1, 100, 2)])
    assert "49 of 99 records lost" in tip.health()


def test_a_clock_that_was_set_back_and_a_pause_are_problems(calibration: FingertipCalibration) -> None:
    tip = Nano17("FF", ReplayTransport("ft/FF", []), VirtualClock(), calibration, Nano17Settings())
    for number, stamp_ms in enumerate((10, 20, 20, 15, 25, 225), start=1):
        tip.update([WrenchSample(stamp_ms * 1_000_000, np.zeros(6), number, 7 * number)])
    told = tip.health()
    assert "stamps went back 1 times: the computer's clock was set" in told
    assert "silent 1 times for more than 100 ms" in told


def test_records_that_the_box_left_out_or_began_anew_are_problems(tip: Nano17) -> None:
    tip.sequences = SequenceMonitor(step=7)
    tip.update([WrenchSample(n, np.zeros(6), n, 14 * n) for n in range(1, 51)])
    assert "the sensor skipped 49 records" in tip.health()
    tip.update([WrenchSample(51, np.zeros(6), 1, 14 * 51)])
    assert "the stream restarted 1 times" in tip.health()


def test_a_torque_that_never_fits_the_force_makes_the_sensor_faulty(
    tip: Nano17, calibration: FingertipCalibration
) -> None:
    stream, still = Stream(tip), weight(calibration, np.eye(3))
    stream.feed(still)
    tip.tare(np.eye(3))
    _, normal, wrench = pressed(calibration, np.array([0, -1.0, 0.2]), np.zeros(3))
    good = pressed(calibration, np.array([0, -1.0, 0.2]), -normal)[2]
    bad = good + np.array([0, 0, 0, 0.03, 0, 0])
    for expected, wrench in ((0, good), (0, bad), (0, bad), (0, bad), (1, bad), (1, bad)):
        tip.begin_capture()
        stream.feed(still + wrench)
        tip.contact(np.eye(3))
        assert sum("torque does not match" in problem for problem in tip.health()) == expected
    tip.begin_capture()
    stream.feed(still + good)
    assert tip.contact(np.eye(3)) is None  # a faulty sensor is not believed, also when it looks right for once


def test_a_turned_sensor_gives_the_same_contact(calibration: FingertipCalibration) -> None:
    """The mounting of the sensor in the tip is undone: same contact, other sensor frame."""
    mounting = {"translation_m": (0.001, 0.005, 0.017), "rpy_rad": (1.5707963267948966, 0.0, 0.4)}
    turned = FingertipCalibration.model_validate(
        calibration.model_dump() | {"distal_T_sensor": mounting, "mass_kg": 0.0}
    )
    point, normal, _ = pressed(calibration, np.array([0.1, -1.0, 0.5]), np.zeros(3))
    pose = turned.distal_T_sensor.pose()
    about_distal = np.concatenate([-normal, np.cross(point, -normal)])
    to_sensor = pose.inverse()
    wrench = wrench_transform(to_sensor.rotation().matrix(), to_sensor.translation()) @ about_distal
    tip = Nano17("FF", ReplayTransport("ft", []), VirtualClock(), turned, Nano17Settings())
    tip.begin_capture()
    Stream(tip).feed(wrench, noise=0.0)
    contact = tip.contact(np.eye(3))
    assert contact is not None
    np.testing.assert_allclose(contact.point_distal_m, point, atol=1e-9)
    np.testing.assert_allclose(contact.normal_distal, -normal, atol=1e-9)


def test_settings_refuse_nonsense() -> None:
    with pytest.raises(ValueError, match="greater than 0"):
        ForceTipSettings(contact_force_N=0.0)
