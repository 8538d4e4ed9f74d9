"""The whole path: physics, device bytes, codecs, devices, contacts, estimation and the conductor on top."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import pytest

from drivers.core.contacts import Array, Contact, Grasp
from drivers.core.poses import transform_points
from drivers.shadow.protocol.palm_codec import decode_command
from drivers.simulation.settings import ObjectStart
from drivers.simulation.world import SimulatedWorld
from sessions.conductor.conductor import Conductor
from sessions.conductor.policy_decisions import Approve, approve_everything
from sessions.conductor.progress import GraspReport, NullProgress
from sessions.conductor.session_outcome import Ending, SessionOutcome
from sessions.motion.cycle_settings import CycleSettings
from sessions.motion.probing.box_prober import ProbingSettings
from sessions.motion.safety import SafetySettings
from sessions.recording.recorder import Recorder
from sessions.recording.session_events import EventKind, SessionEvent
from sessions.recording.traffic.schemas import SESSION_EVENTS_TOPIC, transmitted_topic
from sessions.rig_runtime.rig_runtime import RigRuntime
from tactile_lab.autonomy.autonomous_roles import autonomous_roles
from tactile_lab.autonomy.settings import SessionSettings
from tactile_lab.autonomy.variance_planner import ExplorationSettings
from tactile_lab.rigs.build import build_runtime
from tactile_lab.rigs.description import load_rig
from tactile_lab.slam.slam_settings import SlamSettings
from tactile_lab.slam.tactile_slam import TactileSlam
from tests.support.low_rig import BRISK_WAY

SEED = 0


@dataclass
class MemorySink:
    """Keeps marks and what was sent to the hand; forgets the rest."""

    marks: list[SessionEvent] = field(default_factory=list)
    commands: list[bytes] = field(default_factory=list)

    def write(self, topic: str, data: bytes, stamp_ns: int) -> None:
        if topic == SESSION_EVENTS_TOPIC:
            self.marks.append(SessionEvent.from_bytes(data))
        elif topic == transmitted_topic("hand"):
            self.commands.append(data)


@dataclass(frozen=True)
class TrueGrasp:
    """What really touched at the end of a capture."""

    contacts: tuple[Contact, ...]
    object_origin_m: Array


class Watcher(NullProgress):
    """Keeps the reports; can act at a phase."""

    def __init__(self, act: Callable[[int, str], None] = lambda number, name: None) -> None:
        self.reports: list[GraspReport] = []
        self._act = act

    def phase(self, number: int, name: str) -> None:
        self._act(number, name)

    def grasp_done(self, report: GraspReport) -> None:
        self.reports.append(report)


@dataclass(frozen=True)
class Session:
    """A session that has ended, with everything a test may ask."""

    outcome: SessionOutcome
    sink: MemorySink
    reports: list[GraspReport]
    truth: list[TrueGrasp]


def run(
    grasps: int,
    act: Callable[[SimulatedWorld, int, str], None] = lambda world, number, name: None,
    start: ObjectStart | None = None,
    safety: SafetySettings | None = None,
    weighings: int = 0,
    approve: Approve = approve_everything,
) -> Session:
    rig = load_rig("sim")
    simulation = rig.description.simulation.model_copy(update={"object": "box-10x6x4", "start": start})
    world, sink = SimulatedWorld(simulation, SEED), MemorySink()
    runtime = build_runtime(rig, world, Recorder(sink))
    watcher, truth = Watcher(lambda number, name: act(world, number, name)), watch_truth(runtime, world)
    carrying = ExplorationSettings(policy=None)
    at_once = ProbingSettings(top=False)
    settings = SessionSettings(
        grasps=grasps,
        safety=safety or SafetySettings(),
        exploration=carrying,
        probing=at_once,
        weighings=weighings,
        cycle=CycleSettings(**BRISK_WAY),
    )
    runtime.connect()
    try:
        slam = TactileSlam(SlamSettings(), SEED)
        conductor = Conductor(
            runtime, settings, autonomous_roles(runtime, slam, settings, seed=SEED, approve=approve), watcher
        )
        outcome = conductor.run()
    finally:
        runtime.close()
    return Session(outcome, sink, watcher.reports, truth)


def watch_truth(runtime: RigRuntime, world: SimulatedWorld) -> list[TrueGrasp]:
    """Keep what is true at the end of every capture, without the rig runtime knowing."""
    seen: list[TrueGrasp] = []
    measured = runtime.end_capture

    def end_capture() -> Grasp:
        grasp, truth = measured(), world.truth()
        seen.append(TrueGrasp(truth.contacts, np.asarray(truth.world_T_object.translation())))
        return grasp

    runtime.end_capture = end_capture  # type: ignore[method-assign]
    return seen


@pytest.fixture(scope="module")
def session() -> Session:
    """Three grasps on the 10 x 6 x 4 cm box; the third is chosen by the estimate."""
    return run(3)


@pytest.mark.long
def test_a_held_object_is_weighed() -> None:
    """The box has 300 g."""
    weighed = run(2, weighings=2)
    assert weighed.outcome.ending is Ending.COMPLETE
    assert EventKind.DRAG_END in [mark.kind for mark in weighed.sink.marks]
    mass = weighed.outcome.properties.mass_kg
    assert mass is not None
    assert abs(mass.value - 0.3) < 4 * mass.sigma


@pytest.mark.long
def test_a_person_may_refuse_that_it_is_weighed() -> None:
    kept = run(1, weighings=1, approve=lambda proposal: not proposal.weighs)
    assert EventKind.DRAG_BEGIN not in [mark.kind for mark in kept.sink.marks]
    assert not kept.outcome.properties.is_known


def test_session_completes(session: Session) -> None:
    assert session.outcome.ending is Ending.COMPLETE
    assert [grasp.index for grasp in session.outcome.grasps] == [0, 1, 2]


def test_most_fingers_touch_in_every_grasp(session: Session) -> None:
    counts = [len(grasp.contacts) for grasp in session.outcome.grasps]
    assert min(counts) >= 3
    assert sorted(counts)[1] >= 4  # the median


def test_contacts_are_where_the_fingers_really_touch(session: Session) -> None:
    point_m, normal_deg = [], []
    for grasp, truth in zip(session.outcome.grasps, session.truth, strict=True):
        for contact in grasp.contacts:
            touches = [true for true in truth.contacts if true.finger == contact.finger]
            if touches:
                nearest = min(touches, key=lambda t, c=contact: np.linalg.norm(t.point_world_m - c.point_world_m))
                point_m.append(np.linalg.norm(nearest.point_world_m - contact.point_world_m))
                normal_deg.append(np.degrees(np.arccos(np.clip(nearest.normal_world @ contact.normal_world, -1, 1))))
    assert len(point_m) >= 10
    assert np.median(point_m) < 2.5e-3
    assert np.median(normal_deg) < 8.0


def test_stated_covariance_fits_the_errors(session: Session) -> None:
    """Most errors lie within three standard deviations of what the contact says of itself."""
    inside = []
    for grasp, truth in zip(session.outcome.grasps, session.truth, strict=True):
        for contact in grasp.contacts:
            for true in (true for true in truth.contacts if true.finger == contact.finger):
                error = true.point_world_m - contact.point_world_m
                inside.append(error @ np.linalg.solve(contact.point_covariance_m2, error) < 14.2)  # 3 sigma in 3-D
    assert np.mean(inside) > 0.7


def test_contact_forces_are_gentle(session: Session) -> None:
    for grasp in session.outcome.grasps:
        for contact in grasp.contacts:
            assert 0.1 <= contact.force_N <= (3.0 if contact.finger == "TH" else 1.5)


def test_object_stays_where_it_can_be_reached(session: Session) -> None:
    for truth in session.truth:
        assert np.linalg.norm(truth.object_origin_m[:2]) < 0.06
        assert truth.object_origin_m[2] == pytest.approx(0.020, abs=2e-3)


def test_hand_motion_predicts_the_object_up_to_slip(session: Session) -> None:
    for grasp, before, after in zip(session.outcome.grasps[1:], session.truth, session.truth[1:], strict=False):
        assert 0.1 < abs(grasp.hand_motion_world.rotation().yaw()) < 0.9
        assert grasp.motion_sigma is not None  # the fingertips felt how it moved
        predicted_m = transform_points(grasp.hand_motion_world, before.object_origin_m[None])[0]
        assert np.linalg.norm(predicted_m - after.object_origin_m) < 0.01


def test_marks_tell_the_cycle(session: Session) -> None:
    kinds = [mark.kind for mark in session.sink.marks if mark.kind is not EventKind.TARE]
    measured = [EventKind.CLOSE_BEGIN, EventKind.CAPTURE_BEGIN, EventKind.CAPTURE_END, EventKind.TRUTH_FRAME]
    carried = [EventKind.HOLD_BEGIN, EventKind.HOLD_END]
    assert kinds == [*measured, *carried, *measured, *carried, *measured]
    assert sum(mark.kind is EventKind.TARE for mark in session.sink.marks) >= 3


def test_reports_tell_what_happened(session: Session) -> None:
    assert [report.number for report in session.reports] == [1, 2, 3]
    assert session.reports[0].verdict.startswith("first")
    assert session.reports[2].reason.endswith("mm")  # chosen by what is known of the surface
    told = [report.contacts for report in session.reports]
    assert told == [len(grasp.contacts) for grasp in session.outcome.grasps]


def test_hand_is_without_demand_at_the_end(session: Session) -> None:
    for command in session.sink.commands[-5:]:
        assert not any(decode_command(command).motor_data)


def test_pulled_cable_stops_the_session_and_keeps_its_grasps() -> None:
    def pull(world: SimulatedWorld, number: int, name: str) -> None:
        if (number, name) == (1, "squeeze"):
            world.unplug("hand")

    session = run(3, pull)
    assert session.outcome.ending is Ending.STOPPED
    assert session.outcome.reason.startswith("hand:")
    assert session.outcome.error is not None
    assert len(session.outcome.grasps) == 1


@pytest.mark.long
def test_object_out_of_reach_is_told() -> None:
    session = run(9, start=ObjectStart(x_m=0.3, y_m=0.3, yaw_rad=0.0), safety=SafetySettings(empty_grasps=1))
    assert session.outcome.ending is Ending.OBJECT_LOST
    assert session.outcome.reason.startswith("no contact in 1 grasps in a row; ")


def test_ctrl_c_finishes_the_capture() -> None:
    def interrupt(world: SimulatedWorld, number: int, name: str) -> None:
        if name == "capture":
            os.kill(os.getpid(), signal.SIGINT)

    session = run(9, interrupt)
    assert session.outcome.ending is Ending.INTERRUPTED
    assert len(session.outcome.grasps) == 1
    assert session.sink.marks[-1].kind is EventKind.TRUTH_FRAME
