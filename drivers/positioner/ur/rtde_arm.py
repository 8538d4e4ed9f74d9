"""The arm through the package ur-rtde: taken over with checks, streamed to, given back.

The package uploads a program of its own to the control box, which obeys commands in RTDE's input registers; the box
stops that program, and so the arm, when no command has come for the time of its watchdog. Only the arm's own process
uses this.
"""

from __future__ import annotations

import importlib
import socket
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any

import numpy as np

from drivers.core.clock import NANOSECONDS, Clock
from drivers.core.contacts import Array
from drivers.core.errors import DeviceError
from drivers.positioner.kinematics import mount_joints, mount_T_forearm
from drivers.positioner.ur.checks import PLAYING, Refusal, before_motion, before_program, wrong_version
from drivers.positioner.ur.codec import ArmFlags, ArmState
from drivers.positioner.ur.poses import pose_of, tcp_of
from drivers.positioner.ur.settings import UrSettings

_PORTS = {29999: "dashboard", 30003: "programs", 30004: "RTDE"}
_OUTPUTS = [
    "timestamp",
    "actual_TCP_pose",
    "actual_TCP_force",
    "robot_mode",
    "runtime_state",
    "safety_status_bits",
    "target_speed_fraction",
    "payload",
]
_ANSWER_s = 2.0
_SAME_PAYLOAD_kg, _SAME_PLACE = 0.01, 1e-4
_SILENT_ns = 50_000_000
_FIRST_LOCAL_VERSION = 5
"""PolyScope of this version and later can be in local control."""


class RtdeArm:
    """One arm.

    Args:
        host: its control box.
        settings: limits of the arm.
        clock: for how long it has not been heard.
        name: the device's name, for messages.
    """

    def __init__(self, host: str, settings: UrSettings, clock: Clock, name: str) -> None:
        self._host, self._settings, self._clock, self._name = host, settings, clock, name
        self._news: Any = None
        self._control: Any = None
        self._near_yaw = 0.0
        self._time_s, self._heard_ns = -1.0, clock.now_ns()
        self._free = self._servoing = False
        self.braked = False
        """Whether the stream of targets is withheld until it is restarted."""

    # --- taking it over ----------------------------------------------------------------------------------------

    def connect(self) -> str:
        """Check the arm, take it over, set tool and payload. Nothing moves.

        Returns:
            what was found, for people.

        Raises:
            DeviceError: it does not answer, or must not be moved as it is; says the value and the remedy.
        """
        for port, purpose in _PORTS.items():
            self._knock(port, purpose)
        found = self._identity()
        self._listen()
        self._refuse(before_program(self.state(), self._settings))
        self._control = self._called("rtde_control", "RTDEControlInterface", self._rate_hz)
        self._prepare()
        return f"{found}, payload {self._settings.payload_kg} kg"

    def _listen(self) -> None:
        """Receive from now on: a new connection brings nothing old."""
        if self._news is not None:
            self._news.disconnect()
        self._news = self._called("rtde_receive", "RTDEReceiveInterface", self._rate_hz, _OUTPUTS)

    @property
    def _rate_hz(self) -> float:
        return 1.0 / self._settings.cycle_s

    def _knock(self, port: int, purpose: str) -> None:
        try:
            socket.create_connection((self._host, port), _ANSWER_s).close()
        except OSError as error:
            what = f"no answer at {self._host}, port {port} ({purpose}): {error.strerror or 'timed out'}"
            raise self._error(what, "Check the arm's power, its cable and wires.base.host") from error

    def _called(self, module: str, part: str, *arguments: object) -> Any:
        """A part of the package, connected."""
        try:
            return getattr(importlib.import_module(module), part)(self._host, *arguments)
        except RuntimeError as error:
            words = " ".join(str(error).split())
            if "already in use" in words:
                raise self._error(
                    "another program holds the arm's RTDE inputs",
                    "End it; on the pendant disable EtherNet/IP, PROFINET and MODBUS, then try again",
                ) from error
            raise self._error(f"cannot be taken over ({words})", "Look at the pendant, then try again") from error

    def _identity(self) -> str:
        """Model and version. Raises DeviceError for a version that is not known here, and an arm in local control."""
        dashboard = importlib.import_module("dashboard_client").DashboardClient(self._host)
        try:
            dashboard.connect(round(_ANSWER_s * 1000))
            version = str(dashboard.polyscopeVersion()).removeprefix("URSoftware ").split(" ")[0]
            self._refuse(wrong_version(version))
            if int(version.split(".")[0]) >= _FIRST_LOCAL_VERSION and not dashboard.isInRemoteControl():
                raise self._error("the arm is in local control", "Switch it to remote control at the pendant")
            model = str(dashboard.getRobotModel())  # the first versions that are known here do not tell it
            return f"{model if model.startswith('UR') else 'arm of Universal Robots'}, PolyScope {version}"
        except (RuntimeError, ValueError) as error:
            raise self._error(f"the dashboard does not answer ({error})", "Restart the arm, then try again") from error
        finally:
            with suppress(RuntimeError):
                dashboard.disconnect()

    def _prepare(self) -> None:
        """Set tool, then the watchdog; what was set is read back. An arm that knows its load feels nothing at rest.

        Its position is received again once the tool is set: one with another tool would look like a jump.
        """
        settings = self._settings
        assert settings.flange_T_forearm is not None
        self._told(self._control.setPayload, settings.payload_kg, list(settings.centre_of_gravity_m))
        self._told(self._control.setTcp, list(settings.flange_T_forearm))
        tcp = self._told(self._control.getTCPOffset)
        self._refuse(_unlike("tool centre", tcp, settings.flange_T_forearm, _SAME_PLACE))
        self._listen()
        payload_kg = settings.payload_kg or 0.0
        self._await(lambda: abs(self._news.getPayload() - payload_kg) <= _SAME_PAYLOAD_kg)
        self._refuse(_unlike("payload", [self._news.getPayload()], [payload_kg], _SAME_PAYLOAD_kg))
        self._await_calm()
        self._told(self._control.setWatchdog, settings.watchdog_hz)
        self._refuse(before_motion(self.state(), self.q(), settings))

    def _await(self, condition: Callable[[], bool]) -> None:
        """Wait a moment for what the arm will soon say; what it does not say is for the caller to find."""
        give_up_ns = self._clock.now_ns() + round(_ANSWER_s * NANOSECONDS)
        while not condition() and self._clock.now_ns() < give_up_ns:
            self._clock.sleep_until_ns(self._clock.now_ns() + round(self._settings.cycle_s * NANOSECONDS))

    def _await_calm(self) -> None:
        """The force follows a new payload a moment later."""
        self._await(lambda: before_motion(self.state(), self.q(), self._settings) is None)

    # --- while it is held --------------------------------------------------------------------------------------

    def state(self) -> ArmState:
        """What the arm says of itself now."""
        news, now_ns = self._news, self._clock.now_ns()
        time_s = float(news.getTimestamp())
        if time_s != self._time_s:
            self._time_s, self._heard_ns = time_s, now_ns
        heard = now_ns - self._heard_ns < self._settings.unheard_s * NANOSECONDS
        runtime = int(news.getRuntimeState())
        flags = (
            heard * ArmFlags.HEARD
            | (runtime == PLAYING) * ArmFlags.PROGRAM
            | self._free * ArmFlags.FREE
            | self.braked * ArmFlags.BRAKED
        )
        x, y, z = (float(part) for part in news.getActualTCPForce()[:3])
        return ArmState(
            time_s,
            int(news.getRobotMode()),
            runtime,
            int(news.getSafetyStatusBits()),
            float(news.getTargetSpeedFraction()),
            (x, y, z),
            ArmFlags(flags),
        )

    def q(self) -> Array:
        """Where the tool centre stands, in the six coordinates of the mount, shape (6,)."""
        q = mount_joints(pose_of(self._news.getActualTCPPose()), self._near_yaw)
        self._near_yaw = float(q[3])
        return q

    def servo(self, q: Array) -> None:
        """Stream the next place, shape (6,). Raises DeviceError when the arm does not take it."""
        if self._is_silent(_SILENT_ns):
            return
        settings = self._settings
        self._end_freedrive()
        self._servoing = True
        target = tcp_of(mount_T_forearm(q))
        self._told(
            self._control.servoL, target.tolist(), 0.0, 0.0, settings.cycle_s, settings.lookahead_s, settings.gain
        )

    def _is_silent(self, patience_ns: int) -> bool:
        """Whether to send nothing: the package would wait for the arm's answer, and accept no command meanwhile."""
        return self._clock.now_ns() - self._heard_ns > patience_ns

    def stand(self) -> None:
        """Stop streaming; the arm brakes and stands, but knows that this program is alive."""
        if self._is_silent(round(self._settings.unheard_s * NANOSECONDS)):
            return
        if self._servoing:
            self._servoing = False
            self._told(self._control.servoStop, self._settings.acceleration_m_s2)
        self._told(self._control.kickWatchdog)

    def freedrive(self) -> None:
        """Let a person lead it."""
        if self._is_silent(round(self._settings.unheard_s * NANOSECONDS)):
            return
        if not self._free:
            self.stand()
            self._told(self._control.freedriveMode)
            self._free = True
        self._told(self._control.kickWatchdog)

    def _end_freedrive(self) -> None:
        if self._free:
            self._free = False
            self._told(self._control.endFreedriveMode)

    def restart(self) -> None:
        """After a stop: start the program on the arm again. Raises DeviceError while something forbids it."""
        self.braked = self._servoing = self._free = False
        self._refuse(before_motion(self.state(), self.q(), self._settings))
        if int(self._news.getRuntimeState()) != PLAYING:
            self._told(self._control.reuploadScript)
            self._await(lambda: int(self._news.getRuntimeState()) == PLAYING)
            self._prepare()

    def close(self) -> None:
        """Brake, end the program on the arm, hang up. Idempotent; an arm that is gone stops by itself."""
        control, self._control = self._control, None
        news, self._news = self._news, None
        with suppress(RuntimeError):
            if control is not None and control.isProgramRunning():
                control.servoStop(self._settings.acceleration_m_s2)
                control.stopScript()
        for part in (control, news):
            with suppress(RuntimeError):
                if part is not None:
                    part.disconnect()

    def _told(self, call: Any, *arguments: object) -> Any:
        """What a call of the package gives; it says by False or by an exception that the arm did not take it."""
        try:
            taken = call(*arguments)
        except RuntimeError as error:
            raise self._error(f"does not take commands ({error})", "Check its cable and its program") from error
        if taken is False:
            raise self._error("does not take commands", "See on the pendant why its program has ended")
        return taken

    def _refuse(self, refusal: Refusal | None) -> None:
        if refusal is not None:
            raise self._error(refusal.what, refusal.remedy)

    def _error(self, what: str, hint: str) -> DeviceError:
        return DeviceError(what, where=self._name, hint=hint)


def _unlike(what: str, told: Sequence[float], stated: Sequence[float], most: float) -> Refusal | None:
    if np.abs(np.asarray(told[: len(stated)]) - np.asarray(stated)).max() <= most:
        return None
    shown = ", ".join(f"{value:.4g}" for value in told)
    return Refusal(f"the arm has another {what} than was set: {shown}", "Look at the installation on the pendant")
