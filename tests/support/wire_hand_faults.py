"""Faults in the middle of a session on the rigs sim-wire and sim-ur: over real wires, in real time.

While the fingers close for the first time a fault begins in the process of an emulator, or in the hand's own. What was
sent to the hand and what came from it is then read from the session's recording.
"""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from unittest.mock import patch

from drivers.core.clock import NANOSECONDS
from drivers.core.orders import Order
from drivers.positioner.ur.checks import stop_cause
from drivers.positioner.ur.codec import decode_arm_status
from drivers.positioner.ur.settings import UrSettings
from drivers.shadow.device.hand_settings import HandSettings
from drivers.shadow.device.joint_watch import SensorLimits
from drivers.shadow.device.motor_watch import SILENT_AFTER_s
from drivers.shadow.protocol.motor_data import FromMotor, MotorFlag
from drivers.shadow.protocol.palm_images import PALMS
from drivers.shadow.protocol.palm_messages import PalmStatus
from sessions.conductor.session_outcome import Ending
from sessions.recording.recorder import Recorder
from sessions.recording.session import Session
from sessions.recording.traffic import schemas
from sessions.recording.traffic.reader import TrafficMessage
from sessions.rig_runtime.rig_runtime import RigRuntime
from tactile_lab.rigs.description import Rig
from tactile_lab.rigs.laboratory import WiredLaboratory
from tests.support.at_phase import At
from tests.support.wire_sessions import emulated_laboratory, run

_FFJ3, _CHANNEL = 1, 2  # the motor of FFJ3 and the channel of its sensor
_MUST_MOVE = SensorLimits().frozen_share * HandSettings().gains.of("FFJ3").max_pwm
_PALM = PALMS["0220"]
_CYCLE_s, _SESSION_CYCLE_s = 0.004, 0.01
_BLIND_s = HandSettings().blind_after * _CYCLE_s


@dataclass(frozen=True)
class WireFault:
    """A fault.

    Attributes:
        device: whose emulator is told; ``process`` for the hand's own process.
        order: what it is told; for ``process`` a signal's name.
        told: part of the session's reason; "" if the session goes on.
        rule_s: time that the fault's rule waits (docs/failures.md).
        shows: whether a status of the hand shows it; all do that come after the order unless given. Faults of the arm
            are shown by the arm's statuses.
        while_driven: it can be seen only from when FFJ3 is driven on.
        silences: it is seen by the statuses that no longer come: its time counts from the last one.
        ends: what ends it, and after how long, seconds; None for after the session.
    """

    device: str
    order: Order
    told: str
    rule_s: float = 0.0
    shows: Callable[[PalmStatus], bool] = lambda status: True
    while_driven: bool = False
    silences: bool = False
    ends: tuple[float | None, Order] | None = None


@dataclass(frozen=True)
class WireOutcome:
    """What a session made of a fault.

    Attributes:
        seen_s: from its beginning until a status shows it; None if none does.
        driven_s: from then until the last demand above zero was sent.
        late_cycles: of the hand with a demand above zero after the rule's time.
        reason: why the session ended; "" if it was completed.
    """

    seen_s: float | None
    driven_s: float
    late_cycles: int
    reason: str


def _reads(count: int, told: str) -> WireFault:
    return WireFault(
        "hand", {"stuck": [[_CHANNEL, count]]}, told, shows=lambda status: bool(status.sensors[_CHANNEL] == count)
    )


def _misses(motor: int) -> Callable[[PalmStatus], bool]:
    return lambda status: status.which_motors == motor % 2 and not status.arrived >> motor & 1


def _silent(motors: range) -> WireFault:
    return WireFault("hand", {"silent": [*motors]}, "silent for 50 ms", SILENT_AFTER_s, _misses(motors[0]))


def _reports(kind: FromMotor, least: int) -> Callable[[PalmStatus], bool]:
    def shows(status: PalmStatus) -> bool:
        is_asked = status.motor_data_type == kind and status.which_motors == _FFJ3 % 2
        return is_asked and bool(status.misc[_FFJ3 >> 1] >= least)

    return shows


def _flag(flag: MotorFlag) -> WireFault:
    shows = _reports(FromMotor.FLAGS, int(flag))
    return WireFault("hand", {"flags": [_FFJ3, int(flag)]}, "stopped: halted", shows=shows)


def _gone(seconds: float, told: str = "") -> WireFault:
    back = seconds, {"cable": {"unplugged": False}}
    return WireFault("hand", {"cable": {"unplugged": True}}, told, _BLIND_s, silences=True, ends=back)


HAND_FAULTS: dict[str, WireFault] = {
    "sensor at 0": _reads(0, "its sensor reads 0 counts"),
    "sensor at 4095": _reads(4095, "its sensor reads 4095 counts"),
    "sensor jumps": _reads(1200, "jumps by more than a joint can turn"),
    "sensor frozen": WireFault(
        "hand", {"frozen": [_CHANNEL]}, "while driven", SensorLimits().frozen_s, while_driven=True
    ),
    "one motor silent": _silent(range(1, 2)),
    "ten motors silent": _silent(range(10)),
    "all motors silent": _silent(range(20)),
    "flag: H-bridge": _flag(MotorFlag.BRIDGE_FAULT),
    "flag: stored configuration": _flag(MotorFlag.EEPROM_CRC_BAD),
    "flag: too hot": _flag(MotorFlag.OVER_TEMPERATURE),
    "motor at 57 C": WireFault(
        "hand", {"heat": [_FFJ3, 57.0]}, "57 C, limit 55 C", shows=_reports(FromMotor.TEMPERATURE, 56 << 8)
    ),
    "tendon overloaded": WireFault(
        "hand",
        {"torque": [[_FFJ3, 3500]]},
        "torque over 3000 counts",
        10 * _CYCLE_s,
        lambda status: status.which_motors == _FFJ3 % 2 and bool(status.torque[_FFJ3 >> 1] >= 3500),
    ),
    "palm hung": WireFault("hand", {"hung": True}, "no valid status for 2 s", _BLIND_s, silences=True),
    "link gone for 0.5 s": _gone(0.5),
    "link gone for 1.9 s": _gone(1.9),
    "link gone for 10 s": _gone(10.0, "no valid status for 2 s"),
    "the hand's process killed": WireFault("process", {"signal": "SIGKILL"}, "its process has ended"),
    "the hand's process stopped": WireFault("process", {"signal": "SIGSTOP"}, "no new status for"),
}
"""On sim-wire."""


def _arm(event: str, told: str, remedy: str = "release") -> WireFault:
    return WireFault("base", {"event": event}, told, _SESSION_CYCLE_s, ends=(None, {"event": remedy}))


ARM_FAULTS: dict[str, WireFault] = {
    "arm: protective stop": _arm("protective stop", "protective stop"),
    "arm: emergency stop": _arm("emergency stop", "emergency stop"),
    "arm: program stopped on the pendant": _arm("stop program", "the program on the arm was stopped"),
    "arm: cable unplugged": _arm("unplug", "has stopped answering", "plug"),
}
"""On sim-ur."""


def run_fault(fault: WireFault, rig: Rig, laboratory: WiredLaboratory, root: Path) -> WireOutcome:
    """Run a session of one grasp with a fault.

    Raises:
        AssertionError: the fault never began, or the session did not end as it should.
    """
    injection = _Injection(fault, laboratory)
    with _kept_runtimes(injection.runtimes):
        try:
            outcome, folder = run(rig, laboratory, root, At("close", injection.begin))
        finally:
            injection.end()
    assert injection.begun_ns is not None, "the fault never began"
    reason = "" if outcome.ending is Ending.COMPLETE else outcome.reason
    assert fault.told in reason, reason
    assert bool(reason) == bool(fault.told), reason
    return _outcome(fault, folder, injection.begun_ns, reason)


class _Injection:
    """Begins a fault, and ends it in time."""

    def __init__(self, fault: WireFault, laboratory: WiredLaboratory) -> None:
        self._fault, self._laboratory = fault, laboratory
        self.begun_ns: int | None = None
        self.runtimes: list[RigRuntime] = []
        self._timer: threading.Timer | None = None

    def begin(self) -> None:
        self.begun_ns = self._laboratory.clock.now_ns()
        self._tell(self._fault.order)
        if self._fault.ends is None:
            return
        after_s, order = self._fault.ends
        if after_s is not None:
            self._timer = threading.Timer(after_s, self._tell, (order,))
            self._timer.start()

    def end(self) -> None:
        """Whatever is left of it is over: a hand's emulator starts anew."""
        if self._timer is not None:
            self._timer.join()
        elif self._fault.ends is not None:
            self._tell(self._fault.ends[1])
        if self._fault.device == "hand":
            host = emulated_laboratory(self._laboratory).hosts["hand"]
            host.kill()
            host.start()
            host.await_ready()

    def _tell(self, order: Order) -> None:
        if self._fault.device == "process":
            child = self.runtimes[-1].hand._child  # type: ignore[attr-defined]
            os.kill(child.process_id, signal.Signals[order["signal"]])
        else:
            emulated_laboratory(self._laboratory).hosts[self._fault.device].give(order)


@contextmanager
def _kept_runtimes(runtimes: list[RigRuntime]) -> Iterator[None]:
    """Meanwhile every runtime that a laboratory on wires makes is kept in a list."""
    made = WiredLaboratory.runtime

    def kept(place: WiredLaboratory, recorder: Recorder) -> RigRuntime:
        runtimes.append(made(place, recorder))
        return runtimes[-1]

    with patch.object(WiredLaboratory, "runtime", kept):
        yield


def _outcome(fault: WireFault, folder: Path, begun_ns: int, reason: str) -> WireOutcome:
    """When a recording shows the fault, its last demand above zero, and the demands after the fault's rule."""
    shown_ns: int | None = None
    heard_ns, driven_ns = list[int](), list[int]()
    for message in Session.open(folder).traffic().messages():
        if message.stamp_ns < begun_ns:
            continue
        if shown_ns is None and _shows(fault, message):
            shown_ns = message.stamp_ns
        if message.topic == schemas.received_topic("hand"):
            heard_ns.append(message.stamp_ns)
        if message.topic == schemas.transmitted_topic("hand"):
            demands = _PALM.decode_command(message.data).motor_data
            if any(demands):
                driven_ns.append(message.stamp_ns)
                if fault.while_driven and abs(demands[_FFJ3]) < _MUST_MOVE:
                    shown_ns = message.stamp_ns
    if fault.silences:
        shown_ns = max((stamp_ns for stamp_ns in heard_ns if stamp_ns < max(driven_ns, default=0)), default=None)
    since_ns = begun_ns if shown_ns is None else shown_ns
    due_ns, last_ns = since_ns + round(fault.rule_s * NANOSECONDS), max(driven_ns, default=since_ns)
    seen_s = None if shown_ns is None else (shown_ns - begun_ns) / NANOSECONDS
    late_cycles = sum(stamp_ns > due_ns for stamp_ns in driven_ns)
    return WireOutcome(seen_s, max(0, last_ns - since_ns) / NANOSECONDS, late_cycles, reason)


def _shows(fault: WireFault, message: TrafficMessage) -> bool:
    if message.topic != schemas.received_topic("base" if fault.device == "base" else "hand"):
        return False
    if fault.device == "base":
        return stop_cause(decode_arm_status(message.data).arm, UrSettings()) is not None
    return fault.shows(_PALM.decode_status(message.data))
