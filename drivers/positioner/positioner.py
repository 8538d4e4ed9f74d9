"""The six-axis positioner that carries the hand: a device that never jumps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from drivers.core.clock import NANOSECONDS, Clock
from drivers.core.contacts import Array
from drivers.core.errors import CodecError, DeviceError
from drivers.core.transports import Datagram, Transport
from drivers.positioner.codec import BINARY, LARGEST_SEQUENCE, QUESTION, PositionerCodec, PositionerCommand
from drivers.positioner.kinematics import mount_joints, mount_T_forearm
from drivers.positioner.settings import AXES, PositionerCounters, PositionerSample, PositionerSettings

__all__ = ["Positioner", "PositionerSample", "PositionerSettings", "mount_T_forearm", "mount_joints"]

_LONGEST_STEP_s = 0.05
"""After a pause of the host a step is no longer than after this time."""

_SHORTEST_STEP_s = 1e-6

_BEGINS_ANEW = 1000
"""A status that answers a command so long ago is none that came late: the count began anew."""
_ROUNDING = np.repeat([0.001, 0.005], 3)
"""A target no farther beyond a range is clamped to it; metres and radians."""


class Positioner:
    """The positioner as a device.

    What is sent creeps from the present position to the target within the speed limits, on a straight line in the
    axes. While no status comes nothing is sent any further; a run of lost cycles or an axis that does not follow
    stops the positioner, and every further :meth:`exchange` raises until :meth:`resume`.

    Args:
        transport: whole commands and statuses.
        clock: the session's clock.
        settings: see :class:`PositionerSettings`.
        codec: the form of its messages.
    """

    def __init__(
        self, link: Transport, clock: Clock, settings: PositionerSettings | None = None, codec: PositionerCodec = BINARY
    ) -> None:
        self._transport, self._clock, self._codec = link, clock, codec
        self._settings = settings or PositionerSettings()
        self._range = np.array(self._settings.ranges).T
        self._speed = np.repeat([self._settings.speed_m_s, self._settings.speed_rad_s], 3)
        self._following = np.repeat([self._settings.following_m, self._settings.following_rad], 3)
        self._connected = False
        self._reset()

    def _reset(self) -> None:
        """As new: nothing received, nothing sent."""
        self._heard: int | None = None
        self._before = self._sequence = QUESTION
        self._last: PositionerSample | None = None
        self._sent = self._target = np.zeros(6)
        self._sent_ns = self._clock.now_ns()
        self._stopped = False
        self._fault: tuple[str, str] | None = None
        self._counters = PositionerCounters()

    # --- lifecycle ---------------------------------------------------------------------------------------------

    def connect(self) -> None:
        """Open the transport and ask where the axes stand; nothing moves. All or nothing, repeatable.

        Raises:
            DeviceError: the transport does not open or the positioner does not answer.
        """
        if self._connected:
            return
        self._transport.open()
        try:
            self._reset()
            self._ask()
        except BaseException:
            self._transport.close()
            raise
        self._connected = True

    def close(self) -> None:
        """Close the transport; the positioner holds its last target. Idempotent."""
        if self._connected:
            self._connected = False
            self._transport.close()

    def _ask(self) -> None:
        for _ in range(self._settings.connect_tries):
            self._transport.send(self._codec.encode_command(PositionerCommand(QUESTION, None)))
            self._heard = None
            self._last = self._take(self._transport.receive()[-1:])  # before it may lie answers to an earlier session
            if self._last is not None:
                self._heard, self._sent, self._target = QUESTION, self._last.q, self._last.q
                return
            self._clock.sleep_until_ns(self._clock.now_ns() + round(self._settings.cycle_s * NANOSECONDS))
        raise DeviceError(
            f"no answer to {self._settings.connect_tries} requests",
            where=self._transport.name,
            hint="Check the positioner's power and cable",
        )

    # --- motion ------------------------------------------------------------------------------------------------

    def set_target(self, q: Array) -> None:
        """Set where to go, shape (6,), metres and radians, clamped to the ranges. Without effect while stopped.

        Raises:
            DeviceError: not six finite numbers; or beyond a range by more than rounding, which would leave the hand
                elsewhere than it was sent.
        """
        target = np.asarray(q, dtype=float)
        if target.shape != (6,) or not np.isfinite(target).all():
            raise DeviceError("a target is not six finite numbers", where=self._transport.name, hint="Check the path")
        self._check_range(target)
        if not self._stopped and self._fault is None:
            self._target = np.minimum(np.maximum(target, self._range[0]), self._range[1])

    def _check_range(self, target: Array) -> None:
        """Raises DeviceError: an axis is sent beyond its range, and farther than it stands beyond it."""
        beyond = self._beyond(target) - np.maximum(self._beyond(self._sent), _ROUNDING)
        if (beyond > 0.0).any():
            at = int(np.argmax(beyond / _ROUNDING))
            low, high = self._range[:, at]
            raise DeviceError(
                f"{AXES[at]} was sent to {target[at]:.2f}, and goes from {low:.2f} to {high:.2f}",
                where=self._transport.name,
                hint="Move the object to the middle of the workspace, or correct the ranges in the rig file",
            )

    def _beyond(self, q: Array) -> Array:
        return np.asarray(np.maximum(self._range[0] - q, q - self._range[1]))

    def stop(self) -> None:
        """Stay here until :meth:`resume`. Never raises."""
        self._stopped = True
        self._target = self._sent

    def resume(self) -> None:
        """Take back a stop or a fault; the target is where the positioner stands."""
        self._stopped, self._fault = False, None
        self._counters.lost_in_a_row = 0
        if self._last is not None:
            self._sent = self._target = self._last.q

    # --- the cycle ---------------------------------------------------------------------------------------------

    def exchange(self) -> PositionerSample:
        """One cycle: send the next step towards the target, receive the status.

        Returns:
            The new sample, or after a lost cycle the last one, marked as not fresh.

        Raises:
            DeviceError: not connected; or the positioner has stopped itself, in this cycle or before.
        """
        if not self._connected or self._last is None:
            raise DeviceError("not connected", where=self._transport.name, hint="Connect the positioner first")
        self._send_step()
        sample = self._take(self._transport.receive())
        if sample is None:
            self._last = replace(self._last, fresh=False)
            self._count_loss()
        else:
            self._last, self._counters.lost_in_a_row = sample, 0
            self._check_following(sample)
        self._raise_fault()
        return self._last

    def receive(self, datagram: Datagram) -> PositionerSample | None:
        """Decode one status; None when it repeats the newest one or answers an older command than that.

        Raises:
            CodecError: not a status, or its positions are not six numbers.
        """
        status = self._codec.decode_status(datagram.payload)
        if np.shape(status.q) != (6,) or not np.isfinite(status.q).all():
            raise CodecError("a status without six finite positions", where=self._transport.name)
        behind = _BEGINS_ANEW if self._heard is None else (self._heard - status.sequence) % (LARGEST_SEQUENCE + 1)
        if behind == 0 or (behind < _BEGINS_ANEW and self._heard != QUESTION):
            self._counters.late += behind > 0
            return None
        self._count_left_out(status.sequence)
        self._heard = status.sequence
        return PositionerSample(datagram.stamp_ns, status.q)

    def _send_step(self) -> None:
        now_ns = self._clock.now_ns()
        if not self._counters.lost_in_a_row:
            self._sent = self._step_towards_target((now_ns - self._sent_ns) / NANOSECONDS)
        self._sent_ns = now_ns
        self._before, self._sequence = self._sequence, self._sequence % LARGEST_SEQUENCE + 1
        self._transport.send(self._codec.encode_command(PositionerCommand(self._sequence, self._sent)))
        self._counters.cycles += 1

    def _step_towards_target(self, duration_s: float) -> Array:
        distance = self._target - self._sent
        cycles_needed = (np.abs(distance) / self._speed).max() / max(min(duration_s, _LONGEST_STEP_s), _SHORTEST_STEP_s)
        return self._target if cycles_needed <= 1.0 else self._sent + distance / cycles_needed

    def _take(self, datagrams: list[Datagram]) -> PositionerSample | None:
        newest = None
        for datagram in datagrams:
            try:
                newest = self.receive(datagram) or newest
            except CodecError:
                self._counters.malformed += 1  # shown by health(); the cycle counts as lost
        return newest

    # --- what can go wrong -------------------------------------------------------------------------------------

    def _count_left_out(self, newest: int) -> None:
        """Statuses between the newest and the one before it that never came, and did not count as overdue."""
        if self._heard is None or self._heard == QUESTION:
            return
        left_out = (newest - self._heard) % LARGEST_SEQUENCE - 1  # numbers begin at 1
        if left_out < _BEGINS_ANEW:
            self._counters.lost += max(left_out - self._counters.lost_in_a_row, 0)

    def _count_loss(self) -> None:
        """A cycle without a status; while the command before is answered, the answer to this one is on its way."""
        if self._heard == self._before:
            return
        self._counters.lost += 1
        self._counters.lost_in_a_row += 1
        if self._counters.lost_in_a_row >= self._settings.lost_limit and self._fault is None:
            self._hold(f"stopped after {self._counters.lost_in_a_row} cycles in a row without a status")

    def _check_following(self, sample: PositionerSample) -> None:
        behind = np.abs(self._sent - sample.q) / self._following
        if behind.max() > 1.0 and self._fault is None:
            self._sent = sample.q
            self._hold(f"stopped: {AXES[behind.argmax()]} does not follow, something may block it")

    def _hold(self, what: str, hint: str = "Find the cause, then resume") -> None:
        self._target, self._fault = self._sent, (what, hint)
        self._send_step()  # to stay, before anybody is told

    def _raise_fault(self) -> None:
        """In the cycle of the fault: what else a session drives does not wait for the next."""
        if self._fault is not None:
            raise DeviceError(self._fault[0], where=self._transport.name, hint=self._fault[1])

    # --- state for people --------------------------------------------------------------------------------------

    @property
    def counters(self) -> PositionerCounters:
        """A copy of the counters."""
        return replace(self._counters)

    def health(self) -> tuple[str, ...]:
        """What is wrong with the positioner, in words; empty when all is well."""
        problems = [self._fault[0]] if self._fault is not None else []
        if self._counters.lost:
            problems.append(f"{self._counters.lost} of {self._counters.cycles} cycles lost")
        if self._counters.malformed:
            problems.append(f"{self._counters.malformed} messages were not a positioner status")
        if self._counters.late:
            problems.append(f"{self._counters.late} statuses arrived after newer ones")
        return tuple(problems)
