"""Cycles, losses, health and limits over made stories, compared with before."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
from gtsam import Pose3

from drivers.core.clock import VirtualClock
from drivers.core.errors import DeviceError
from sessions.motion.safety import SafetySettings, SafetySupervisor
from sessions.recording.recorder import Recorder
from sessions.rig_runtime.cycle_timing import CycleTiming
from sessions.rig_runtime.flight_recorder import CycleSnapshot, FlightRecorder
from tests.support.baseline import assert_baseline
from tests.support.digest import digest_records
from tests.support.said import said
from tests.support.session_fakes import make_rig, play_session
from tests.support.told_session import Kept

MS = 1_000_000


def test_deadlines_of_cycles_that_are_late() -> None:
    clock = VirtualClock()
    timing, told = CycleTiming(clock, 10 * MS), list[Any]()
    for between_ms, devices_ms in (
        (0, 2),
        (0, 10),
        (0, 11),
        (1, 9),
        (3, 25),
        (0, 0),
        (150, 49),
        (0, 0),
        (150, 50),
        (60, 140),
        (5000, 0),
        (0, 200),
    ):
        clock.sleep_until_ns(clock.now_ns() + between_ms * MS)
        timing.begin()
        clock.sleep_until_ns(clock.now_ns() + devices_ms * MS)
        told.append([timing.begun_ns, timing.lateness(), *vars(timing.counts).values()])
        timing.wait()
        told[-1].append(clock.now_ns())
    for _ in range(600):
        timing.begin()
        timing.wait()
    told.append([timing.lateness(), clock.now_ns()])
    timing.restart()
    clock.sleep_until_ns(clock.now_ns() + 33 * MS)
    timing.begin()
    timing.wait()
    told.append([clock.now_ns(), *vars(timing.counts).values()])
    slow = CycleTiming(clock, 40 * MS)
    for busy_ms in (399, 400):
        slow.begin()
        clock.sleep_until_ns(clock.now_ns() + busy_ms * MS)
        told.append(slow.lateness())
        slow.wait()
    assert_baseline("sessions/runtime/cycles", {"told": told})


def test_a_runtime_and_all_that_it_records() -> None:
    """A session of fakes: state samples, losses, and problems of devices that come and grow."""
    kept, heard = Kept(), list[str]()

    class Truth:
        world_T_object, contacts = Pose3(), ()

    rig = make_rig(Recorder(kept), seed=2, damage=0.02, truth=Truth)
    runtime = rig.runtime
    runtime.report_problems_to(heard.append)
    rig.devices["hand"].lost = {"cycles": 3}
    told: dict[str, Any] = {"grasps": len(play_session(rig, 2))}
    rig.devices["base"].health = lambda: (
        f"base: {runtime.counts.cycles // 20} of {runtime.counts.cycles} cycles lost",
    )  # type: ignore[attr-defined]
    runtime.run(300 * MS)
    runtime.begin_capture()
    runtime.end_touch()
    told["undone"] = said(lambda: runtime.undo().index)
    told["fingers"] = said(lambda: runtime.tare(["FF", "XX"]))
    told["picture"] = said(lambda: len(runtime.picture().payload))  # type: ignore[attr-defined]
    told["dragged"] = [said(runtime.begin_dragging), said(runtime.end_dragging), said(runtime.end_hanging)]
    runtime.restart_fingertip("FF")
    runtime.lead_by_hand()
    snapshot = runtime.snapshot().plain()
    told["snapshot"] = {key: snapshot[key] for key in ("stamp_ns", "hand_age_ms", "tip_age_ms", "warmest_C", "void")}
    said(runtime.close)
    told |= {"heard": heard, "losses": dict(runtime.losses), "cycles": vars(runtime.counts), "calls": rig.calls[-16:]}
    logs = [json.loads(data) for topic, data, _ in kept.messages if topic == "/events"]
    told["logs"] = [[entry["level"], entry["name"], entry["message"]] for entry in logs]
    topics: dict[str, list[Any]] = {}
    for topic, data, stamp_ns in kept.messages:
        topics.setdefault(topic, []).append(
            {"stamp_ns": stamp_ns, "size": len(data) if topic.startswith("/link") else 0}
        )
    told["topics"] = {topic: digest_records(found) for topic, found in sorted(topics.items())}
    rig.runtime.camera = None
    told["no camera"] = [said(runtime.picture), said(runtime.truth_frame)]
    assert_baseline("sessions/runtime/recorded", told, rtol=1e-6)


class Quiet:
    """What the supervisor stops; it may fail."""

    def __init__(self) -> None:
        self.calls: list[str] = []
        self.reports: list[Any] = []

    def stop(self) -> None:
        self.calls.append("stop")

    def cycle(self) -> None:
        self.calls.append("cycle")
        if len(self.calls) % 2:
            raise DeviceError(f"silent {len(self.calls) > 4}", where="hand")

    def report_stop(self, cause: str, cycles: list[Any]) -> None:
        self.reports.append([cause, len(cycles), cycles[-1:]])


def snapshot(at_ms: float = 0.0, **changes: Any) -> CycleSnapshot:
    stamp_ns = round(at_ms * MS)
    return CycleSnapshot(
        **({"stamp_ns": stamp_ns, "hand_stamp_ns": stamp_ns, "loads_N": {}, "palm_world_m": None} | changes)
    )


def test_limits_and_what_is_just_within_them() -> None:
    kinds: dict[str, list[CycleSnapshot]] = {
        "silent hand": [snapshot(at_ms, hand_stamp_ns=0) for at_ms in (49, 50, 51, 2500, 2500.1)],
        "never heard": [snapshot(at_ms, hand_stamp_ns=None) for at_ms in (5, 56, 2505, 2506)],
        "silent tip": [snapshot(at_ms, tip_stamps_ns={"FF": 0, "TH": round(at_ms * MS)}) for at_ms in (200, 200.1)],
        "tip never heard": [snapshot(at_ms, tip_stamps_ns={"FF": None}) for at_ms in (0, 200, 201)],
        "force": [snapshot(loads_N={"FF": load_N}) for load_N in (6.0, 6.1, 6.1, 6.0, 6.1, 6.1, 6.1)],
        "small sensor": [snapshot(loads_N={"FF": 5.1}, force_ranges_N={"FF": 10.0}) for _ in range(4)],
        "large sensor": [snapshot(loads_N={"FF": 5.9}, force_ranges_N={"FF": 20.0}) for _ in range(4)],
        "invalid": [snapshot(loads_N={"FF": float("nan")}) for _ in range(3)],
        "void": [snapshot(loads_N={"FF": float("inf")}, void_tips={"FF": "saturated"}) for _ in range(3)],
        "low": [snapshot(palm_world_m=np.array([0.0, 0.0, z])) for z in (0.05, 0.0499)],
        "far": [snapshot(palm_world_m=np.array([0.27, y, 0.2])) for y in (0.36, 0.3601)],
        "warm": [snapshot(warmest_C=warmest_C) for warmest_C in (None, 49.9, 50.0, 20.0)],
    }
    told: dict[str, Any] = {}
    for name, snapshots in kinds.items():
        watch = SafetySupervisor(Quiet(), SafetySettings(), 10 * MS)
        told[name] = []
        for each in snapshots:
            found = said(lambda watch=watch, each=each: watch.check(each))
            told[name].append([found, watch.hand_is_silent, watch.speed_scale, watch.careful_scale])
    patient = SafetySupervisor(Quiet(), SafetySettings(stale_cycles=30), 100 * MS)
    told["slow cycles"] = [
        [said(lambda at_ms=at_ms: patient.check(snapshot(at_ms, hand_stamp_ns=0))), patient.hand_is_silent]
        for at_ms in (0, 3000, 3001)
    ]
    watch = SafetySupervisor(Quiet(), SafetySettings(workspace_centre_m=(0.1, -0.1)), 10 * MS)
    told["time"] = [
        watch.time_over(10**15),
        said(lambda: watch.check(snapshot(1.0))),
        watch.time_over(3_600_001 * MS),
        watch.time_over(3_600_001 * MS + 1),
    ]
    told["lost"] = [watch.object_lost(0.1 + x, -0.1) for x in (0.0, 0.2499, 0.2501, -1.0)]
    for contacts in (0, 0, 3, 0, 0, 0):
        watch.count_contacts(contacts)
        told["lost"].append(watch.object_lost(0.1, -0.1))
    watch.on_approach()
    told["approached"] = watch.speed_scale
    assert_baseline("sessions/runtime/limits", told)


def test_a_stop_and_the_last_cycles() -> None:
    told: dict[str, Any] = {}
    for name, cause in {
        "end": None,
        "error": DeviceError("silent True", where="hand"),
        "interrupt": KeyboardInterrupt(),
    }.items():
        quiet = Quiet()
        watch = SafetySupervisor(quiet, SafetySettings(), 10 * MS)
        for n in range(120):
            palm = None if n < 20 else np.array([0.0, 0.01, 0.2])
            tips = {"LF": 10 * n * MS, "TH": 10 * n * MS - 5}
            stamps = {"hand_stamp_ns": 10 * n * MS - 7, "tip_stamps_ns": tips}
            watch.check(snapshot(10.0 * n, warmest_C=20.0 + n / 10, palm_world_m=palm, **stamps))
        told[name] = [watch.stop(cause), quiet.calls, quiet.reports]
    recorder = FlightRecorder()
    for n in range(101):
        recorder.note(snapshot(float(n)))
    told["kept"] = [len(recorder.plain()), recorder.plain()[0]["stamp_ns"], recorder.plain()[-1]["stamp_ns"]]
    assert_baseline("sessions/runtime/stops", told)
