"""Checks a real hand: connects it and reads it for a moment with zero demands. Nothing moves."""

from __future__ import annotations

import numpy as np

from drivers.core.clock import NANOSECONDS, Clock
from drivers.core.errors import DeviceError
from drivers.shadow.device.cycle_pace import CyclePace
from drivers.shadow.device.cycle_statistics import CycleStatistics
from drivers.shadow.device.first_move import check_motor_map
from drivers.shadow.device.hand import ShadowHand
from drivers.shadow.device.hand_samples import HandSample
from drivers.shadow.device.hand_setup import HandSetup
from drivers.shadow.device.motor_polling import PollingRates
from drivers.shadow.device.real_time import PRIORITY, prefer
from drivers.shadow.ethercat.hand_transport import EthercatTransport
from drivers.shadow.ethercat.pysoem_transport import PysoemTransport
from drivers.shadow.model.joint_calibration import JointCalibration
from drivers.shadow.model.kinematics import JOINTS
from drivers.shadow.model.motors import MotorMap
from drivers.shadow.protocol.motor_data import SlowData
from drivers.shadow.protocol.palm_codec import SENSORS
from tactile_lab.rigs.checks.findings import LOSSY, TOLERATED_LOSS, Finding, told
from tactile_lab.rigs.checks.tactile import TactileLook
from tactile_lab.rigs.hand_rig import HandRig

LISTEN_ns = 1_500_000_000
_ONCE = -2.0  # in the words of motor_data_polling.yaml
_COUNTS = range(1, 4095)
_JOINT_CHANNELS = 26
_HALTED = "halted, no demand for 20 ms"  # the hand goes on: it knows that it made a pause
_PAUSED = (
    "the cycle paused so long that motors halted: close other programs, or permit real-time scheduling (limits.conf)"
)


def check_hand(rig: HandRig, clock: Clock, *, move: bool = False) -> list[Finding]:
    """Findings of ring, cycle, motors and joint sensors; a hand that does not connect ends the list.

    Args:
        rig: of a hand alone.
        clock: the monotonic one.
        move: also move every motor slightly, to check that it moves the joint in the map.

    Raises:
        ConfigurationError: a file the rig names, or a master that is not installed.
    """
    setup = _asking_who(rig.setup)
    setup.check_files()
    try:
        return _findings(setup.with_known_palm(clock), clock, move=move)
    except DeviceError as error:
        return [Finding("hand", False, str(error))]


def _findings(setup: HandSetup, clock: Clock, *, move: bool) -> list[Finding]:
    transport = setup.transport(clock)
    hand = setup.device(transport, clock, set_up_boards=False)
    try:
        hand.connect()
        with prefer(PRIORITY):
            return _hear(setup, transport, hand, clock, move=move)
    finally:
        _close(hand)


def _hear(
    setup: HandSetup, transport: EthercatTransport | PysoemTransport, hand: ShadowHand, clock: Clock, *, move: bool
) -> list[Finding]:
    form, motors = setup.form(), setup.motor_map()
    tips = TactileLook(setup.hand.tactile, form.fingers)
    sample, statistics = _listen(hand, tips, clock, round(setup.hand.cycle_s * NANOSECONDS))
    found = [
        _ring(transport),
        _cycle(hand, transport, statistics),
        _motors(hand, sample, motors),
        _joints(sample, setup.calibration()),
    ]
    found += tips.findings()
    return [*found, _motor_map(hand, motors, clock, setup.hand.cycle_s)] if move else found


def _asking_who(setup: HandSetup) -> HandSetup:
    """The same hand, which also reads constant data of motors and fingertips once: firmware, names."""
    settings = setup.settings()
    asking = settings.model_copy(update={"polling": ask_once(settings.polling), "tactile_names": True})
    return setup.model_copy(update={"hand": asking, "rates": None})


def ask_once(rates: PollingRates) -> PollingRates:
    """The same rates, with the motors' slow data requested once after connecting."""
    return rates.model_copy(update={"slow_data": _ONCE})


def _motor_map(hand: ShadowHand, motors: MotorMap, clock: Clock, cycle_s: float) -> Finding:
    def cycle() -> HandSample:
        clock.sleep_until_ns(clock.now_ns() + round(cycle_s * NANOSECONDS))
        return hand.exchange()

    moved = check_motor_map(hand, motors, cycle, clock)
    wrong = [str(finding) for finding in moved if not finding.ok]
    words: tuple[str, ...] = () if wrong else (f"each of {len(moved)} motors moves its own joint",)
    left_out = [joint for joint in motors.driven if joint not in hand.drivable]
    words += (f"not to be driven: {', '.join(left_out)}",) if left_out else ()
    return told("motor map", wrong, words, {})


def _close(hand: ShadowHand) -> None:
    try:
        hand.close()
    except DeviceError:
        return  # it failed while it was listened to, which has been told


def _listen(hand: ShadowHand, tips: TactileLook, clock: Clock, cycle_ns: int) -> tuple[HandSample, CycleStatistics]:
    """Run cycles for a time, however long a busy computer takes for each."""
    statistics, pace = CycleStatistics(), CyclePace(clock, cycle_ns)
    for _ in range(LISTEN_ns // cycle_ns):
        statistics.add(*pace.wait())
        sample = hand.exchange()
        tips.take(sample)
    return sample, statistics


def _ring(transport: EthercatTransport | PysoemTransport) -> Finding:
    found = transport.hand
    watchdog = "no watchdog" if found.watchdog_s is None else f"watchdog {1000 * found.watchdog_s:.0f} ms"
    words = f"hand {found.serial}, palm {found.image.name} revision {found.palm.revision}, in operation, {watchdog}"
    return Finding("ring", True, words)


def _cycle(hand: ShadowHand, transport: EthercatTransport | PysoemTransport, statistics: CycleStatistics) -> Finding:
    counters, remarks = hand.counters, transport.health()
    share = counters.lost / max(counters.cycles, 1)
    words = f"{statistics.summary()}; {counters.lost} of {counters.cycles} without a status"
    punctual = statistics.summary()
    figures = {"start_late_p50_us": punctual.median_us, "start_late_p99_us": punctual.p99_us, "lost_share": share}
    advice: tuple[str, ...] = () if share < TOLERATED_LOSS else (LOSSY,)
    advice += (_PAUSED,) if any(words.endswith(_HALTED) for words in hand.health()) else ()
    return told("cycle", advice, (words, *remarks), figures)


def _motors(hand: ShadowHand, sample: HandSample, motors: MotorMap) -> Finding:
    problems = [words for words in hand.health() if "cycles lost" not in words and not words.endswith(_HALTED)]
    temperature, supply = sample.motor.temperature_C, sample.motor.voltage_V
    heard = np.isfinite(temperature)[motors.is_fitted]
    if not heard.any():
        return told("motors", (*problems, "no motor has reported its temperature"), (), {})
    hottest = int(np.nanargmax(temperature))
    figures = f"{int(heard.sum())} of {heard.size} answer, warmest {motors.names[hottest]} {temperature[hottest]:.0f} C"
    if np.isfinite(supply).any():
        figures += f", supply {np.nanmin(supply):.1f} V"
    revisions = firmware(sample)
    figures += f", firmware revision {revisions}" if revisions else ""
    numbers: dict[str, float | str] = {
        "firmware": revisions,
        "warmest_C": float(temperature[hottest]),
        "answering": float(heard.sum()),
        "spare_us": float(sample.idle_us),
    }
    missing = () if problems or heard.all() else ("not every motor answers",)
    return told("motors", (*problems, *missing), (figures,), numbers)


def firmware(sample: HandSample) -> str:
    """Revisions of the motors' firmware, which should be equal; empty while none was received."""
    revisions = sample.motor.slow[SlowData.SVN_REVISION]
    return ", ".join(f"{revision:.0f}" for revision in np.unique(revisions[np.isfinite(revisions)]))


def _joints(sample: HandSample, calibration: JointCalibration) -> Finding:
    """A joint sensor at the end of its range has lost its magnet or its cable; a fixed joint needs none."""
    counts = zip(SENSORS, sample.status.sensors[:_JOINT_CHANNELS].tolist(), strict=False)
    turning = {joint for joint, turns in zip(JOINTS, calibration.turns, strict=True) if turns}
    own = [(name, count) for name, count in counts if str(name)[:4] in turning]  # THJ5 and WRJ1 have two each
    dead = [f"{name} reads {count}" for name, count in own if count not in _COUNTS]
    return told("joint sensors", dead, () if dead else (f"all {len(own)} within their range",), {})
