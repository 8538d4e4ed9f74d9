"""The emulated control box: modes, the pendant's switches, and the program that ur-rtde uploads.

It does not interpret programs: it knows the numbers of the commands of that package's own program, version 1.6, and
does what the program's text says. It has no joints either: the tool centre goes where it is sent, at once.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Literal, Protocol

import numpy as np
from gtsam import Pose3, Rot3

from drivers.core.clock import NANOSECONDS, Clock
from drivers.core.contacts import Array
from drivers.emulators.ur.rtde_server import Value, type_of
from drivers.positioner.ur.poses import pose_of, tcp_of

_GRAVITY_m_s2 = 9.81
_RUNNING, _IDLE = 7, 5
_STOPPED, _PLAYING, _PAUSED = 1, 2, 4
_NORMAL, _PROTECTIVE, _EMERGENCY = 0b1, 0b100, 0b10000000
_READY, _DONE = 1, 2
_PROGRAM_MARK = "RTDE Control Script"
_AT_ONCE = frozenset({0, 24})
"""Commands that do not wait for the one before: nothing, and a target to follow."""

Series = Literal["e", "cb3"]


class CarriedForearm(Protocol):
    """What the arm carries, in the arm's base frame."""

    def place(self) -> Pose3:
        """Where the forearm is."""

    def move(self, base_T_forearm: Pose3, /) -> None:
        """Send it there."""


class ControlBox:
    """One control box and its arm.

    Args:
        forearm: what it moves.
        clock: real time.
        flange_T_forearm: where the forearm truly is on the flange.
        mass_kg: what truly hangs on the flange.
        series: e-Series, or CB3.
    """

    def __init__(
        self, forearm: CarriedForearm, clock: Clock, flange_T_forearm: Pose3, mass_kg: float, series: Series = "e"
    ) -> None:
        self._forearm, self._clock, self._mass_kg = forearm, clock, mass_kg
        self._flange_T_forearm = flange_T_forearm
        self._flange_T_tcp = Pose3()
        self.version: tuple[int, int, int, int] = (5, 12, 0, 1101319) if series == "e" else (3, 15, 8, 106339)
        self.highest_Hz = 500.0 if series == "e" else 125.0
        self.robot_mode, self.safety_bits, self.runtime_state = _RUNNING, _NORMAL, _STOPPED
        self.speed_fraction, self.remote, self.plugged = 1.0, True, True
        self.payload_kg, self.pushed_N = 0.0, 0.0
        self._inputs: dict[str, float] = {}
        self._owners: dict[str, object] = {}
        self._registers: dict[str, float] = {}
        self._executing = False
        self._watchdog_ns: int | None = None
        self._heard_ns = clock.now_ns()
        self.free = False
        """Whether a person can lead the arm."""
        self.stopped_ns: int | None = None
        """When the last program ended."""
        self._program = dict[int, Callable[[], None]](
            {
                16: self._stand,
                17: self._set_payload,
                24: self._servo,
                29: self._set_tcp,
                35: self._set_watchdog,
                40: self._tell_tcp,
                52: self._begin_freedrive,
                53: self._end_freedrive,
                255: self.stop_program,
            }
        )

    # --- the ports ---------------------------------------------------------------------------------------------

    def output(self, name: str) -> Value:
        """The present value of an RTDE output."""
        match name:
            case "timestamp":
                return self._clock.now_ns() / NANOSECONDS
            case "actual_TCP_pose":
                return tuple(
                    tcp_of(self._forearm.place() * self._flange_T_forearm.inverse() * self._flange_T_tcp).tolist()
                )
            case "actual_TCP_force":
                return (self.pushed_N, 0.0, (self.payload_kg - self._mass_kg) * _GRAVITY_m_s2, 0.0, 0.0, 0.0)
            case "payload" | "speed_scaling" | "target_speed_fraction":
                return self.payload_kg if name == "payload" else self.speed_fraction
            case "robot_status_bits":
                return 1 | 2 * (self.runtime_state == _PLAYING)
            case "robot_mode" | "safety_status_bits" | "runtime_state":
                return {
                    "robot_mode": self.robot_mode,
                    "safety_status_bits": self.safety_bits,
                    "runtime_state": self.runtime_state,
                }[name]
        empty: Value = (0.0,) * 6 if type_of(name) == "VECTOR6D" else 0
        return self._registers.get(name, empty)

    def claim(self, client: object, names: Sequence[str]) -> list[str]:
        """Reserve inputs; ``IN_USE`` for those of another client."""
        types = [type_of(name) if self._owners.get(name, client) is client else "IN_USE" for name in names]
        if "IN_USE" not in types:
            self._owners |= dict.fromkeys(names, client)
        return types

    def on_gone(self, client: object) -> None:
        """A client has hung up."""
        self._owners = {name: owner for name, owner in self._owners.items() if owner is not client}

    def on_inputs(self, values: Mapping[str, Value]) -> None:
        """Inputs were written: the running program looks at them."""
        self._inputs |= {name: value for name, value in values.items() if not isinstance(value, Sequence)}
        self._heard_ns = self._clock.now_ns()
        if self.runtime_state == _PLAYING:
            self._obey(int(self._inputs.get("input_int_register_0", 0)))

    def on_program(self, text: str) -> None:
        """A program was uploaded; only that of ur-rtde is known here, and only a ready arm runs it."""
        if _PROGRAM_MARK in text and self.remote and self.robot_mode == _RUNNING and self.safety_bits == _NORMAL:
            self.runtime_state, self._executing, self._watchdog_ns = _PLAYING, False, None
            self._registers["output_int_register_0"] = _READY
            self._inputs["input_int_register_0"] = 0

    def on_dashboard(self, line: str) -> str:
        """The dashboard's answer to a line."""
        match line.strip().lower().split():
            case ["polyscopeversion"]:
                return "URSoftware " + ".".join(map(str, self.version)) + " (emulated)"
            case ["is", "in", "remote", "control"] if self.version[0] > 3:
                return str(self.remote).lower()
            case ["get", "robot", "model"] if self.version >= (3, 12):
                return "UR10"
            case ["get", "serial", "number"]:
                return "20000000000"
            case ["running"]:
                return f"Program running: {str(self.runtime_state == _PLAYING).lower()}"
            case ["stop"]:
                self.stop_program()
                return "Stopped"
            case ["popup", *_]:
                return "showing popup"
        return f"could not understand: '{line.strip()}'"

    def tick(self) -> None:
        """What happens by itself: the watchdog of the program."""
        silent_ns = self._clock.now_ns() - self._heard_ns
        if self._watchdog_ns is not None and self.runtime_state == _PLAYING and silent_ns > self._watchdog_ns:
            self.stop_program()

    # --- the pendant, and what befalls an arm ------------------------------------------------------------------

    def befall(self, event: str, value: float = 0.0) -> None:
        """Something that a person or the world does, by its name in :data:`EVENTS`. Raises KeyError for another."""
        EVENTS[event](self, value)

    def stop_by_safety(self, safety_bits: int) -> None:
        """The safety system stops the arm and holds its program."""
        self.safety_bits = safety_bits
        self._end(_PAUSED)

    def release(self, value: float = 0.0) -> None:
        """A person has released the stop and switched the arm on; its program does not run."""
        self.safety_bits, self.robot_mode = _NORMAL, _RUNNING

    def power_off(self, value: float = 0.0) -> None:
        """The brakes are on."""
        self.robot_mode = _IDLE
        self._end(_STOPPED)

    def carry(self, mass_kg: float) -> None:
        """Something else hangs on the flange."""
        self._mass_kg = mass_kg

    def lead(self, up_m: float) -> None:
        """A person lifts the hand by so much; an arm gives way in freedrive alone."""
        if self.free:
            self._forearm.move(Pose3(Rot3(), np.array([0.0, 0.0, up_m])) * self._forearm.place())

    def stop_program(self) -> None:
        """The program ends; the arm stands."""
        self._end(_STOPPED)

    def _end(self, runtime_state: int) -> None:
        if self.runtime_state == _PLAYING:
            self._stand()
            self.stopped_ns = self._clock.now_ns()
        self.runtime_state, self.free, self._watchdog_ns = runtime_state, False, None

    # --- the program -------------------------------------------------------------------------------------------

    def _obey(self, command: int) -> None:
        if command in _AT_ONCE or not self._executing:
            self._registers["output_int_register_0"] = _READY if command in _AT_ONCE else _DONE
            self._program.get(command, lambda: None)()
        self._executing = command not in _AT_ONCE

    def _numbers(self, first: int, count: int) -> Array:
        return np.array([self._inputs.get(f"input_double_register_{first + k}", 0.0) for k in range(count)])

    def _stand(self) -> None:
        self._forearm.move(self._forearm.place())

    def _servo(self) -> None:
        base_T_flange = pose_of(self._numbers(0, 6)) * self._flange_T_tcp.inverse()
        self._forearm.move(base_T_flange * self._flange_T_forearm)

    def _set_payload(self) -> None:
        self.payload_kg = float(self._numbers(0, 1)[0])

    def _set_tcp(self) -> None:
        self._flange_T_tcp = pose_of(self._numbers(0, 6))

    def _tell_tcp(self) -> None:
        for number, value in enumerate(tcp_of(self._flange_T_tcp).tolist()):
            self._registers[f"output_double_register_{number}"] = value

    def _set_watchdog(self) -> None:
        self._watchdog_ns = round(NANOSECONDS / float(self._numbers(0, 1)[0]))

    def _begin_freedrive(self) -> None:
        self.free = True

    def _end_freedrive(self) -> None:
        self.free = False
        self._stand()


def _set(name: str) -> Callable[[ControlBox, float], None]:
    return lambda box, value: setattr(box, name, value)


EVENTS: Mapping[str, Callable[[ControlBox, float], None]] = {
    "protective stop": lambda box, _: box.stop_by_safety(_PROTECTIVE),
    "emergency stop": lambda box, _: box.stop_by_safety(_EMERGENCY),
    "release": ControlBox.release,
    "stop program": lambda box, _: box.stop_program(),
    "start program": lambda box, _: setattr(box, "runtime_state", _PLAYING),
    "power off": ControlBox.power_off,
    "speed slider": _set("speed_fraction"),
    "push": _set("pushed_N"),
    "carry": ControlBox.carry,
    "lead": ControlBox.lead,
    "local control": lambda box, _: setattr(box, "remote", False),
    "unplug": lambda box, _: setattr(box, "plugged", False),
    "plug": lambda box, _: setattr(box, "plugged", True),
}
"""What befalls an arm; of some the value counts: a share, newtons, kilograms, metres."""
