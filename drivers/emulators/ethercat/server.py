"""The emulated hand in a separate process, on one end of a cable: ``python -m drivers.emulators.ethercat.server``.

It reads its settings, and later orders, as lines of JSON on standard input, and answers each with one line. It ends
when standard input ends, so it never outlives the program that started it.

Orders: ``{"cable": {...}}`` sets fields of :class:`~drivers.emulators.ethercat.ring.CableFaults`; ``{"hung": true}``
stops the palm's processor; ``{"service_ns": n}`` slows it; ``{"silent": [motors]}``, ``{"frozen": [channels]}``,
``{"stuck": [[channel, counts], ...]}`` and ``{"torque": [[motor, counts], ...]}`` set fields of
:class:`~drivers.simulation.devices.palm_emulator.PalmFaults`; ``{"flags": [motor, bits]}`` and ``{"heat": [motor,
celsius]}`` happen to a motor; ``{"fall": [state, code]}`` lets the palm leave its state; ``{"power_cycle": true}``;
``{"announce": [bus, identifier, hex]}`` lets a motor send a frame on its CAN bus. Every answer contains the counts.
"""

from __future__ import annotations

import dataclasses
import json
import select
import sys
from pathlib import Path
from typing import Any

from drivers.core.child_process import ChildProcess, errors_said, say
from drivers.core.clock import NANOSECONDS, Clock, MonotonicClock, VirtualClock
from drivers.emulators.ethercat.motor_can import MotorCanBuses
from drivers.emulators.ethercat.shadow_chain import ChainSettings, EmulatedHand, emulated_hand
from drivers.emulators.ethercat.stamped_port import StampedPort
from drivers.ethercat.registers import AlState
from drivers.shadow.device.real_time import request_real_time
from drivers.shadow.model.gains import load_gains
from drivers.shadow.model.hand_form import HandForm
from drivers.shadow.model.joint_calibration import JointCalibration
from drivers.shadow.model.motors import MotorMap
from drivers.shadow.protocol.palm_codec import CanFrame

_IDLE_s, _LOOK_ns = 0.02, 5_000_000
_START_s, _ANSWER_s = 30.0, 5.0


class HandServer:
    """Serves frames, and obeys orders until these end.

    The hand's time is that of its wire. A frame is processed as of its time of arrival, however late this program reads
    it, and between two frames time advances only as far as it is certain that no frame has arrived. A real palm is
    never suspended by an operating system. So its motors halt, and its watchdog trips, only because the master paused,
    never because this program did.

    Args:
        hand: the hand to serve; its time is advanced only here.
        time: the hand's clock.
        port: the port at its end of the cable.
        can: the motors' buses.
        clock: the clock of the port's stamps.
    """

    def __init__(
        self, hand: EmulatedHand, time: VirtualClock, port: StampedPort, can: MotorCanBuses, clock: Clock
    ) -> None:
        self._hand, self._time, self._port, self._can, self._clock = hand, time, port, can, clock
        self._look_ns = clock.now_ns()

    def run(self) -> None:
        """Serve. Raises DeviceError if the interface disappears."""
        while True:
            now_ns = self._clock.now_ns()
            if (frame := self._port.receive(self._patience_s(now_ns))) is not None:
                self._pass_to(self._port.arrived_ns)
                for answer in self._hand.ring.process(frame):
                    self._port.send(answer)
                continue
            self._pass_to(now_ns)
            self._hand.ring.work()
            if self._has_order():
                if not (line := sys.stdin.readline()):
                    return
                say(self._obey(json.loads(line)))

    def _pass_to(self, stamp_ns: int) -> None:
        """Advance the hand's time, doing everything that is due until then at its time."""
        while (due_ns := self._hand.ring.due_ns) is not None and due_ns <= stamp_ns:
            self._time.sleep_until_ns(due_ns)
            self._hand.ring.work()
        self._time.sleep_until_ns(stamp_ns)

    def _patience_s(self, now_ns: int) -> float:
        due_ns = self._hand.ring.due_ns
        return _IDLE_s if due_ns is None else max(due_ns - now_ns, 0) / NANOSECONDS

    def _has_order(self) -> bool:
        """Whether an order waits, or standard input has ended; checked only now and then, as it costs a system call."""
        now_ns = self._clock.now_ns()
        if now_ns < self._look_ns:
            return False
        self._look_ns = now_ns + _LOOK_ns
        return bool(select.select([sys.stdin], [], [], 0)[0])

    def _obey(self, order: dict[str, Any]) -> dict[str, Any]:
        hand = self._hand
        for name, value in order.get("cable", {}).items():
            setattr(hand.ring.faults, name, value)
        hand.palm.hung = order.get("hung", hand.palm.hung)
        hand.palm.service_ns = order.get("service_ns", hand.palm.service_ns)
        self._spoil(order)
        if "fall" in order:
            state, code = order["fall"]
            hand.palm_slave.fall_to(AlState(state), code)
        if "power_cycle" in order:
            for slave in hand.ring.slaves:
                slave.power_cycle()
        if "announce" in order:
            bus, identifier, data = order["announce"]
            payload = bytes.fromhex(data)
            self._can.announce(CanFrame(bus, len(payload), identifier, payload.ljust(8, b"\0")))
        return self._counts()

    def _spoil(self, order: dict[str, Any]) -> None:
        """Obey what an order says of sensors and motors."""
        palm, motors = self._hand.palm.palm, self._hand.palm.motors
        for name in ("silent", "frozen"):
            setattr(palm.faults, name, set(order.get(name, getattr(palm.faults, name))))
        for name in ("stuck", "torque"):
            setattr(palm.faults, name, dict(order.get(name, getattr(palm.faults, name))))
        if "flags" in order:
            motors.raise_flags(*order["flags"])
        if "heat" in order:
            motors.heat(*order["heat"])

    def _counts(self) -> dict[str, Any]:
        hand = self._hand
        counts = dataclasses.asdict(hand.ring.counts) | dataclasses.asdict(hand.palm_slave.counts)
        counts |= {"can_frames": len(set(self._can.heard))}  # the status of a late cycle comes twice
        return counts | {"served": hand.palm.served, "state": str(hand.palm_slave.al_status)}


def main() -> None:
    """Read the first line, create the hand, and serve it."""
    clock = MonotonicClock()
    with errors_said():
        start = json.loads(sys.stdin.readline())
        motors = _motor_map(start)
        calibration = JointCalibration.load(Path(start["joints"]), HandForm(driven=motors.driven).joints)
        can = MotorCanBuses()
        time, port = VirtualClock(clock.now_ns()), StampedPort(start["interface"], clock)
        hand = emulated_hand(time, calibration, ChainSettings(**start["settings"]), motors, can)
        port.open()
        say({"ready": True})
        request_real_time()
        HandServer(hand, time, port, can, clock).run()


def _motor_map(start: dict[str, Any]) -> MotorMap:
    motors = MotorMap.load(Path(start["motors"]) if start["motors"] else None)
    return motors.reverse(load_gains(Path(start["gains"]), motors.driven).backwards) if start["gains"] else motors


class EmulatedHandProcess:
    """Runs the emulated hand in another process; a context manager.

    Args:
        interface: network interface that it serves.
        joints: joint calibration file, used in reverse.
        settings: the kind of hand.
        motors: motor map; the simulated hand's unless given.
        gains: Shadow's gains, whose signs state which motors turn backwards; none does unless given.
    """

    def __init__(
        self,
        interface: str,
        joints: Path,
        settings: ChainSettings | None = None,
        motors: Path | None = None,
        gains: Path | None = None,
    ) -> None:
        self._start = {
            "interface": interface,
            "joints": str(joints),
            "motors": str(motors or ""),
            "gains": str(gains or ""),
            "settings": dataclasses.asdict(settings or ChainSettings()),
        }
        self._child = ChildProcess("drivers.emulators.ethercat.server", "emulated hand")

    def __enter__(self) -> EmulatedHandProcess:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def start(self) -> None:
        """Start it and wait until it serves.

        Raises:
            DeviceError: it does not start; the message is its own.
        """
        self._child.start(self._start)
        self._child.ready(_START_s)

    def order(self, **order: Any) -> dict[str, Any]:
        """Give an order (see the module); returns the counts after it.

        Raises:
            DeviceError: the process has ended.
        """
        self._child.give(order)
        return self._child.answer(_ANSWER_s)

    def kill(self) -> None:
        """Kill it at once, like a power cut."""
        self._child.kill()

    def close(self) -> None:
        """End it; idempotent."""
        self._child.close()


if __name__ == "__main__":
    main()
