"""Safety limits, and the stop when one is exceeded.

The supervisor checks every cycle. An exceeded limit raises :class:`SafetyError`; the session's runner then calls
:meth:`SafetySupervisor.stop`, as after every other failure: zero demands to the hand and the positioner held in place,
for several cycles (the hand's own motors halt 20 ms after the last demand). The reason goes into the recording with the
last cycles. docs/real-laboratory.md says what the hand and its process monitor, and how soon each cause leads to zero
demands.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable
from contextlib import suppress
from math import isfinite
from types import FrameType, TracebackType
from typing import Any, Protocol

from pydantic import Field

from drivers.core.clock import NANOSECONDS
from drivers.core.configuration import StrictModel
from drivers.core.contacts import Array
from drivers.core.errors import SafetyError, TactileLabError
from sessions.rig_runtime.flight_recorder import CycleSnapshot, FlightRecorder


class SafetySettings(StrictModel):
    """The limits.

    Attributes:
        force_limit_N: largest contact force on any fingertip.
        force_share: largest contact force as a share of the sensor's calibrated range on its smallest axis; the smaller
            of both limits applies.
        force_cycles: cycles in a row over the limit that stop the rig: a fingertip that slips along the object jerks.
        hold_s: without a new hand status for this long everything waits where it is, the hand's own demands being
            gone; never less than ``stale_cycles`` cycles.
        stale_s: without one for this long the rig stops; a little more than the hand's own patience with its link.
        stale_cycles: see ``hold_s``, ``stale_s`` and ``tip_stale_s``.
        tip_stale_s: the same for the readings of a fingertip with its own transport.
        warm_C: above this temperature of the warmest motor everything moves at ``warm_scale`` of its speed.
        warm_scale: see ``warm_C``.
        palm_minimum_height_m: lowest height of the palm's origin above the table.
        workspace_radius_m: largest horizontal distance of the palm's origin from the workspace centre.
        workspace_centre_m: centre of the workspace on the table, world x, y.
        object_radius_m: an object estimated farther than this from the workspace centre is lost.
        empty_grasps: this many grasps in a row without any contact mean that the object is gone.
        session_limit_s: longest session, by the session's clock.
        first_moves_scale: speed of the first approach as a share of the normal speed, but for taps, slow by themselves.
    """

    force_limit_N: float = Field(default=6.0, gt=0.0)
    force_share: float = Field(default=0.5, gt=0.0, le=0.8)
    force_cycles: int = Field(default=3, ge=1)
    hold_s: float = Field(default=0.05, gt=0.0)
    stale_s: float = Field(default=2.5, gt=0.0)
    stale_cycles: int = Field(default=5, ge=1)
    tip_stale_s: float = Field(default=0.2, gt=0.0)
    warm_C: float = Field(default=50.0, gt=0.0)
    warm_scale: float = Field(default=0.5, gt=0.0, le=1.0)
    palm_minimum_height_m: float = Field(default=0.05, ge=0.0)
    workspace_radius_m: float = Field(default=0.45, gt=0.0)
    workspace_centre_m: tuple[float, float] = (0.0, 0.0)
    object_radius_m: float = Field(default=0.25, gt=0.0)
    empty_grasps: int = Field(default=3, ge=1)
    session_limit_s: float = Field(default=3600.0, gt=0.0)
    first_moves_scale: float = Field(default=0.4, gt=0.0, le=1.0)


class Stoppable(Protocol):
    """What the supervisor can stop: the rig runtime."""

    def stop(self) -> None:
        """Zero hand demands, hold the base."""

    def cycle(self) -> object:
        """One cycle over all devices."""

    def report_stop(self, cause: str, cycles: list[dict[str, Any]]) -> None:
        """Record why everything was stopped, with the last cycles."""


_STOP_CYCLES = 5
_SWAY_m = 0.005
"""A positioner is so far off its targets as it sets off and stops."""


class SafetySupervisor:
    """Checks each cycle against the limits and knows how to stop.

    Args:
        runtime: what to stop.
        settings: the limits.
        cycle_ns: length of a cycle.

    Attributes:
        hand_is_silent: at the last look the hand had not been heard for so long that everything has to wait.
    """

    def __init__(self, runtime: Stoppable, settings: SafetySettings, cycle_ns: int) -> None:
        self._runtime, self.settings = runtime, settings
        patience_ns = settings.stale_cycles * cycle_ns
        self._stale_ns = max(round(settings.stale_s * NANOSECONDS), patience_ns)
        self._tip_stale_ns = max(round(settings.tip_stale_s * NANOSECONDS), patience_ns)
        self._hold_ns = max(round(settings.hold_s * NANOSECONDS), patience_ns)
        self.hand_is_silent = False
        self._flight_recorder = FlightRecorder()
        self._warm = False
        self._start_ns: int | None = None
        self._over_limit: dict[str, int] = {}
        self._empty_grasps = 0
        self._approached = False

    # --- every cycle -------------------------------------------------------------------------------------------

    def check(self, snapshot: CycleSnapshot) -> None:
        """Compare one cycle with the limits.

        Raises:
            SafetyError: a limit is exceeded.
        """
        if self._start_ns is None:
            self._start_ns = snapshot.stamp_ns
        self._flight_recorder.note(snapshot)
        self._warm = snapshot.warmest_C is not None and snapshot.warmest_C >= self.settings.warm_C
        self._check_freshness(snapshot)
        self._check_forces(snapshot)
        if snapshot.palm_world_m is not None:
            self._check_workspace(snapshot.palm_world_m)

    def _check_freshness(self, snapshot: CycleSnapshot) -> None:
        silent_ns = self._silent_ns(snapshot, snapshot.hand_stamp_ns)
        self.hand_is_silent = silent_ns > self._hold_ns
        if silent_ns > self._stale_ns:
            raise SafetyError(
                f"no new status for {silent_ns / 1e6:.0f} ms", where="hand", hint="Check cable, power and the bus"
            )
        for finger, stamp_ns in snapshot.tip_stamps_ns.items():
            if (silent_ns := self._silent_ns(snapshot, stamp_ns)) > self._tip_stale_ns:
                what = f"no reading from the fingertip for {silent_ns / 1e6:.0f} ms"
                raise SafetyError(what, where=finger, hint="Check the sensor's box, power and cable")

    def _silent_ns(self, snapshot: CycleSnapshot, heard_ns: int | None) -> int:
        last_ns = self._start_ns if heard_ns is None else heard_ns
        return 0 if last_ns is None else snapshot.stamp_ns - last_ns

    def _check_forces(self, snapshot: CycleSnapshot) -> None:
        limits_N = {finger: self.force_limit_N(snapshot.force_ranges_N.get(finger)) for finger in snapshot.loads_N}
        over = {f: load_N for f, load_N in snapshot.loads_N.items() if not load_N <= limits_N[f]}  # NaN is over
        self._over_limit = {finger: self._over_limit.get(finger, 0) + 1 for finger in over}
        for finger, cycles in self._over_limit.items():
            if cycles < self.settings.force_cycles:
                continue
            if not isfinite(over[finger]):
                what = f"its readings are invalid: {snapshot.void_tips.get(finger) or 'not numbers'}"
                hint = "Take the hand off the object, then check the sensor: tactile-lab rig check"
                raise SafetyError(what, where=finger, hint=hint)
            what = f"fingertip force {over[finger]:.1f} N is over the limit of {limits_N[finger]:.1f} N"
            raise SafetyError(what, where=finger, hint="Check the hand and the object before continuing")

    def force_limit_N(self, range_N: float | None) -> float:
        """Force limit of a fingertip whose sensor has this range; None if it has none."""
        own_N = self.settings.force_limit_N
        return own_N if range_N is None else min(own_N, self.settings.force_share * range_N)

    def _check_workspace(self, palm_world_m: Array) -> None:
        x_m, y_m, height_m = palm_world_m.tolist()
        if height_m < self.settings.palm_minimum_height_m:
            raise SafetyError(f"palm only {height_m * 1e3:.0f} mm above the table", where="base", hint="Lift the arm")
        if (out_m := self._from_centre_m(x_m, y_m)) > self.settings.workspace_radius_m:
            raise SafetyError(f"palm {out_m * 1e3:.0f} mm from the workspace centre", where="base", hint="Move it back")

    def is_well_inside(self, x_m: float, y_m: float) -> bool:
        """Whether the palm may go to world x, y: a little inside of the edge at which it is stopped."""
        return self._from_centre_m(x_m, y_m) < self.settings.workspace_radius_m - _SWAY_m

    # --- between cycles ----------------------------------------------------------------------------------------

    def time_over(self, stamp_ns: int) -> str | None:
        """Why no further grasp should start at this time, or None."""
        if self._start_ns is None or stamp_ns - self._start_ns <= self.settings.session_limit_s * NANOSECONDS:
            return None
        return f"the session limit of {self.settings.session_limit_s:.0f} s has been reached"

    def object_lost(self, x_m: float, y_m: float) -> str | None:
        """Why an object estimated at world x, y counts as lost, or None."""
        if self._empty_grasps >= self.settings.empty_grasps:
            return f"no contact in {self._empty_grasps} grasps in a row"
        out_m = self._from_centre_m(x_m, y_m)
        if out_m <= self.settings.object_radius_m:
            return None
        return f"the object is {out_m * 100:.0f} cm from the workspace centre"

    def count_contacts(self, contacts: int) -> None:
        """Note how many contacts a grasp had."""
        self._empty_grasps = 0 if contacts else self._empty_grasps + 1

    @property
    def speed_scale(self) -> float:
        """Factor on all speeds: slow until the first approach has succeeded, and while a motor is warm."""
        return self.careful_scale * (1.0 if self._approached else self.settings.first_moves_scale)

    @property
    def careful_scale(self) -> float:
        """Factor on speeds that were chosen for a first touch: slow only while a motor is warm."""
        return self.settings.warm_scale if self._warm else 1.0

    def on_approach(self) -> None:
        """The first approach has succeeded: normal speed from now on."""
        self._approached = True

    # --- stopping ----------------------------------------------------------------------------------------------

    def stop(self, cause: BaseException | None = None) -> tuple[str, ...]:
        """Zero demands and hold the base, for several cycles. Never raises.

        Args:
            cause: why, unless the session ends normally; recorded with the last cycles.

        Returns:
            What went wrong while stopping, as sentences; a dead device does not answer any more.
        """
        self._runtime.stop()
        problems: dict[str, None] = {}
        for _ in range(_STOP_CYCLES):
            try:
                self._runtime.cycle()
            except TactileLabError as error:
                problems[str(error)] = None
        if cause is not None:
            words = str(cause) or "stopped immediately by the operator"
            with suppress(TactileLabError):  # a recording that is broken has ended the session already
                self._runtime.report_stop(words, self._flight_recorder.plain())
        return tuple(words for words in problems if cause is None or words != str(cause))

    def _from_centre_m(self, x_m: float, y_m: float) -> float:
        centre_x_m, centre_y_m = self.settings.workspace_centre_m
        return float(((x_m - centre_x_m) ** 2 + (y_m - centre_y_m) ** 2) ** 0.5)


class InterruptGuard:
    """Ctrl+C once: finish the step and close the session.

    Twice: stop now. A context manager; while it is open the first SIGINT only sets :attr:`requested`, and every later
    one does what it did before, or raises KeyboardInterrupt if it was ignored. Signals reach only the main thread:
    elsewhere the guard does nothing.
    """

    def __init__(self) -> None:
        self.requested = False
        self.heard: Callable[[], None] = lambda: None
        """Called immediately by the first SIGINT, at any point of the program: it may only note it."""
        self._previous: Callable[[int, FrameType | None], Any] | int | None = None
        self._active = False

    def __enter__(self) -> InterruptGuard:
        if threading.current_thread() is threading.main_thread():
            self._previous = signal.signal(signal.SIGINT, self._on_interrupt)
            self._active = True
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._active:
            signal.signal(signal.SIGINT, self._previous)
            self._active = False

    def _on_interrupt(self, number: int, frame: FrameType | None) -> None:
        if not self.requested:
            self.requested = True
            self.heard()
        elif callable(self._previous):
            self._previous(number, frame)  # it knows where an interruption would be lost
        else:
            raise KeyboardInterrupt
