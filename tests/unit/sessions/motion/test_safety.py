"""Safety: limits, freshness, the way to stop, and Ctrl+C."""

from __future__ import annotations

import os
import signal
import threading
from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from drivers.core.contacts import Array
from drivers.core.errors import DeviceError, SafetyError
from sessions.motion.safety import InterruptGuard, SafetySettings, SafetySupervisor
from sessions.rig_runtime.flight_recorder import CycleSnapshot

CYCLE_ns = 10_000_000


@dataclass
class StoppableRuntime:
    """Counts stops and the cycles after them; can fail."""

    failure: Exception | None = None
    calls: list[str] = field(default_factory=list)
    reports: list[tuple[str, list[dict[str, object]]]] = field(default_factory=list)

    def stop(self) -> None:
        self.calls.append("stop")

    def cycle(self) -> None:
        self.calls.append("cycle")
        if self.failure is not None:
            raise self.failure

    def report_stop(self, cause: str, cycles: list[dict[str, object]]) -> None:
        self.reports.append((cause, cycles))


def supervisor(**settings: object) -> SafetySupervisor:
    return SafetySupervisor(StoppableRuntime(), SafetySettings(**settings), CYCLE_ns)  # type: ignore[arg-type]


def palm_at(x: float, y: float, z: float) -> Array:
    return np.array([x, y, z])


def snapshot(
    stamp_ns: int = 0,
    hand_stamp_ns: int | None = 0,
    loads_N: dict[str, float] | None = None,
    palm: Array | None = None,
) -> CycleSnapshot:
    return CycleSnapshot(stamp_ns, hand_stamp_ns, loads_N or {}, palm_at(0, 0, 0.2) if palm is None else palm)


def test_an_ordinary_cycle_passes() -> None:
    supervisor().check(snapshot(loads_N={"FF": 0.5, "TH": 2.0}))


@pytest.mark.parametrize("load_N", [6.1, 50.0])
def test_too_much_force_stops_and_names_the_finger(load_N: float) -> None:
    watch = supervisor(force_cycles=2)
    watch.check(snapshot(loads_N={"FF": 0.5, "TH": load_N}))
    with pytest.raises(SafetyError, match="TH: fingertip force"):
        watch.check(snapshot(loads_N={"FF": 0.5, "TH": load_N}))


@pytest.mark.parametrize("load_N", [float("inf"), float("nan")])
def test_a_fingertip_that_tells_no_force_stops_with_the_reason(load_N: float) -> None:
    watch = supervisor(force_cycles=2)
    void = replace(snapshot(loads_N={"TH": load_N}), void_tips={"TH": "Fz at 150 % of the calibration range"})
    watch.check(void)
    with pytest.raises(SafetyError, match="TH: its readings are invalid: Fz at 150 % of the calibration range"):
        watch.check(void)
    with pytest.raises(SafetyError, match="TH: its readings are invalid: not numbers"):
        watch.check(snapshot(loads_N={"TH": load_N}))


def test_a_jerk_shorter_than_the_allowed_cycles_passes() -> None:
    watch = supervisor(force_cycles=2)
    for load_N in (9.0, 0.5, 9.0, 0.5):
        watch.check(snapshot(loads_N={"FF": load_N}))


def test_force_at_the_limit_passes() -> None:
    supervisor(force_limit_N=3.0).check(snapshot(loads_N={"FF": 3.0}))


def test_the_limit_follows_the_sensors_calibrated_range() -> None:
    watch = supervisor(force_share=0.5, force_cycles=1)
    ranges = {"FF": 4.0, "TH": 50.0}
    watch.check(replace(snapshot(loads_N={"FF": 1.9, "TH": 5.9}), force_ranges_N=ranges))
    with pytest.raises(SafetyError, match=r"FF: fingertip force 2.1 N is over the limit of 2.0 N"):
        watch.check(replace(snapshot(loads_N={"FF": 2.1}), force_ranges_N=ranges))
    with pytest.raises(SafetyError, match=r"TH: fingertip force 6.1 N is over the limit of 6.0 N"):
        watch.check(replace(snapshot(loads_N={"TH": 6.1}), force_ranges_N=ranges))


def test_a_silent_fingertip_stops_and_is_named() -> None:
    watch = supervisor(tip_stale_s=0.2)
    heard = {"FF": 200_000_000, "MF": 10_000_000}
    watch.check(replace(snapshot(stamp_ns=210_000_000, hand_stamp_ns=210_000_000), tip_stamps_ns=heard))
    with pytest.raises(SafetyError, match="MF: no reading from the fingertip for 240 ms"):
        watch.check(replace(snapshot(stamp_ns=250_000_000, hand_stamp_ns=250_000_000), tip_stamps_ns=heard))


def test_a_fingertip_that_never_speaks_stops() -> None:
    watch = supervisor(tip_stale_s=0.2)
    silent = {"FF": None}
    watch.check(replace(snapshot(), tip_stamps_ns=silent))
    with pytest.raises(SafetyError, match="FF: no reading"):
        watch.check(replace(snapshot(stamp_ns=300_000_000, hand_stamp_ns=300_000_000), tip_stamps_ns=silent))


def test_a_warm_motor_slows_everything_down() -> None:
    watch = supervisor(warm_C=50.0, warm_scale=0.5)
    watch.on_approach()
    for warmest_C, scale in ((None, 1.0), (49.9, 1.0), (50.0, 0.5), (40.0, 1.0)):
        watch.check(replace(snapshot(), warmest_C=warmest_C))
        assert watch.speed_scale == scale


def test_low_palm_stops() -> None:
    with pytest.raises(SafetyError, match="palm only 40 mm above the table"):
        supervisor().check(snapshot(palm=palm_at(0, 0, 0.04)))


def test_palm_outside_the_workspace_stops() -> None:
    with pytest.raises(SafetyError, match="palm 500 mm from the workspace centre"):
        supervisor().check(snapshot(palm=palm_at(0.3, 0.4, 0.2)))


def test_workspace_is_about_its_own_centre() -> None:
    supervisor(workspace_centre_m=(0.3, 0.4)).check(snapshot(palm=palm_at(0.3, 0.4, 0.2)))


def test_stale_hand_stops_after_the_allowed_cycles() -> None:
    watch = supervisor(stale_cycles=5, stale_s=0.01)
    watch.check(snapshot(stamp_ns=5 * CYCLE_ns, hand_stamp_ns=0))
    with pytest.raises(SafetyError, match="no new status for 60 ms"):
        watch.check(snapshot(stamp_ns=6 * CYCLE_ns, hand_stamp_ns=0))


def test_a_hand_that_is_silent_for_a_moment_has_everything_wait() -> None:
    watch, silent = supervisor(stale_cycles=5), []
    for now, heard in ((5, 0), (6, 0), (7, 7)):
        watch.check(snapshot(stamp_ns=now * CYCLE_ns, hand_stamp_ns=heard * CYCLE_ns))
        silent.append(watch.hand_is_silent)
    assert silent == [False, True, False]


def test_stale_time_rules_on_fast_cycles() -> None:
    watch = SafetySupervisor(StoppableRuntime(), SafetySettings(stale_s=0.010, stale_cycles=2), cycle_ns=1_000_000)
    watch.check(snapshot(stamp_ns=10_000_000, hand_stamp_ns=0))
    with pytest.raises(SafetyError, match="no new status"):
        watch.check(snapshot(stamp_ns=11_000_000, hand_stamp_ns=0))


def test_hand_that_never_answers_stops() -> None:
    watch = supervisor(stale_cycles=5, stale_s=0.01)
    watch.check(snapshot(stamp_ns=1000, hand_stamp_ns=None))
    with pytest.raises(SafetyError, match="no new status"):
        watch.check(snapshot(stamp_ns=1000 + 6 * CYCLE_ns, hand_stamp_ns=None))


def test_session_time_runs_out() -> None:
    watch = supervisor(session_limit_s=10.0)
    assert watch.time_over(10**12) is None  # nothing has begun
    watch.check(snapshot(stamp_ns=5_000_000_000, hand_stamp_ns=5_000_000_000))
    assert watch.time_over(15_000_000_000) is None
    assert "session limit of 10 s" in str(watch.time_over(15_000_000_001))


def test_object_far_away_is_lost() -> None:
    watch = supervisor()
    assert watch.object_lost(0.15, 0.19) is None
    assert watch.object_lost(0.18, 0.24) == "the object is 30 cm from the workspace centre"


def test_object_is_lost_after_empty_grasps_in_a_row() -> None:
    watch = supervisor(empty_grasps=2)
    for contacts in (0, 3, 0):
        watch.count_contacts(contacts)
    assert watch.object_lost(0.0, 0.0) is None
    watch.count_contacts(0)
    assert watch.object_lost(0.0, 0.0) == "no contact in 2 grasps in a row"


def test_first_approach_is_slow() -> None:
    watch = supervisor(first_moves_scale=0.4)
    assert watch.speed_scale == pytest.approx(0.4)
    watch.on_approach()
    assert watch.speed_scale == 1.0


def test_stop_sends_zero_demands_for_several_cycles() -> None:
    runtime = StoppableRuntime()
    assert SafetySupervisor(runtime, SafetySettings(), CYCLE_ns).stop() == ()
    assert runtime.calls == ["stop", *["cycle"] * 5]


def test_stop_tells_what_failed_and_never_raises() -> None:
    runtime = StoppableRuntime(failure=DeviceError("link is down", where="hand"))
    assert SafetySupervisor(runtime, SafetySettings(), CYCLE_ns).stop() == ("hand: link is down",)
    assert runtime.calls.count("cycle") == 5


def test_the_cause_is_told_with_the_last_cycles() -> None:
    runtime = StoppableRuntime()
    watch = SafetySupervisor(runtime, SafetySettings(), CYCLE_ns)
    for cycle in range(150):
        stamp_ns = cycle * CYCLE_ns
        watch.check(snapshot(stamp_ns, stamp_ns - 1_000_000, {"FF": 0.01 * cycle}))
    watch.stop()
    assert runtime.reports == []  # an ordinary end
    watch.stop(SafetyError("too much", where="FF"))
    ((cause, cycles),) = runtime.reports
    assert cause == "FF: too much"
    assert len(cycles) == 100
    assert cycles[-1]["load_N"] == {"FF": pytest.approx(1.49)}
    assert cycles[-1]["hand_age_ms"] == 1.0
    watch.stop(KeyboardInterrupt())
    assert runtime.reports[1][0] == "stopped immediately by the operator"


def test_first_interrupt_is_noted_second_is_immediate() -> None:
    before = signal.getsignal(signal.SIGINT)
    with InterruptGuard() as guard:
        assert not guard.requested
        os.kill(os.getpid(), signal.SIGINT)
        assert guard.requested
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGINT)
    assert signal.getsignal(signal.SIGINT) is before


def test_handler_comes_back_after_an_error() -> None:
    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(ValueError, match="broken"), InterruptGuard():
        raise ValueError("broken")
    assert signal.getsignal(signal.SIGINT) is before


def test_guard_does_nothing_outside_the_main_thread() -> None:
    seen: list[bool] = []

    def work() -> None:
        with InterruptGuard() as guard:
            seen.append(guard.requested)

    worker = threading.Thread(target=work)
    worker.start()
    worker.join()
    assert seen == [False]
