"""What devices say to be wrong reaches the recording and a person, once each, and with its last figures at the end."""

from __future__ import annotations

from sessions.recording.recorder import NullTraffic, Recorder
from sessions.rig_runtime.health_watch import HealthWatch
from tests.support.session_fakes import make_rig


def watch(*looks: list[str]) -> tuple[list[tuple[str, str]], list[str]]:
    told: list[tuple[str, str]] = []
    heard: list[str] = []
    health = HealthWatch(lambda device, text: told.append((device, text)))
    health.listener = heard.append
    for problems in looks:
        health.look(problems)
    health.conclude(looks[-1])
    return told, heard


def test_a_fault_is_told_when_it_begins_and_with_its_last_figures_at_the_end() -> None:
    told, heard = watch([], ["base: 1 of 9 cycles lost"], ["base: 3 of 12 cycles lost"])
    assert told == [("base", "1 of 9 cycles lost"), ("base", "total: 3 of 12 cycles lost")]
    assert heard == ["base: 1 of 9 cycles lost"]


def test_a_fault_that_has_passed_stands_in_the_summary() -> None:
    told, _ = watch(["FF: 2.5 N beyond"], [])
    assert told[-1] == ("FF", "total: 2.5 N beyond")


def test_motors_are_told_apart_and_what_is_usual_at_rest_is_no_fault() -> None:
    told, _ = watch(["FF: not tared", "hand: FFJ3 (motor 1): warm, 51 C", "hand: FFJ4 (motor 2): warm, 51 C"])
    assert [text for _, text in told[:2]] == ["FFJ3 (motor 1): warm, 51 C", "FFJ4 (motor 2): warm, 51 C"]
    assert not any("tared" in text for _, text in told)


def test_a_bench_tells_what_its_devices_and_fingertips_say() -> None:
    rig, heard = make_rig(Recorder(NullTraffic())), []
    rig.devices["base"].health = lambda: ("base: 3 cycles lost",)
    rig.runtime.report_problems_to(heard.append)
    rig.runtime.connect()
    rig.runtime.fingertips["MF"].fault = "reading beyond the calibration range"
    rig.runtime.run(200_000_000)
    rig.runtime.close()
    assert heard == ["base: 3 cycles lost", "MF: reading beyond the calibration range"]
