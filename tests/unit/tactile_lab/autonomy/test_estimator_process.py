"""Estimation and planning in a process of their own: the same results bit for bit, and what becomes of a failure."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from drivers.core.clock import VirtualClock
from drivers.core.configuration import validate
from drivers.core.errors import DeviceError, EstimationError, SessionError, ShapeError
from sessions.conductor.conductor import Conductor
from sessions.conductor.decisions import Decision, SessionRoles, UndoGrasp
from sessions.conductor.estimator_client import LocalClient
from sessions.conductor.policy_decisions import PolicyDecisions, record_choices
from sessions.conductor.progress import NullProgress
from sessions.conductor.session_outcome import Ending, SessionOutcome
from sessions.recording.recorder import Recorder
from sessions.recording.traffic import schemas
from tactile_lab.autonomy.autonomous_roles import autonomous_roles
from tactile_lab.autonomy.estimator_process import EstimatorProcess
from tactile_lab.autonomy.estimator_worker import pack
from tactile_lab.autonomy.settings import SessionSettings
from tactile_lab.slam.slam_settings import SlamSettings
from tactile_lab.slam.tactile_slam import TactileSlam
from tactile_lab.workflow.finishing import estimate_rest
from tests.support import questions
from tests.support.disc_world import Disc, DiscWorld
from tests.support.questions import Counting
from tests.support.repository import REPOSITORY

QUICK = {"landing_force_N": 0.25, "squeeze_s": 0.1, "finger_rad_s": 20.0, "travel_m_s": 1.0, "turn_rad_s": 5.0}


@pytest.fixture(autouse=True, scope="module")
def support_is_found() -> Iterator[None]:
    """The other process finds this folder's support modules as the tests do."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", str(REPOSITORY))
        yield


class BriefClock:
    """Real to a session: it goes on while others compute. A cycle takes a moment: now and then a longer one, as every
    rest may last much longer on a busy computer."""

    def __init__(self) -> None:
        self._now_ns = self._cycles = 0

    def now_ns(self) -> int:
        return self._now_ns

    def sleep_until_ns(self, deadline_ns: int) -> None:
        self._cycles += 1
        if self._cycles % 20 == 0:
            time.sleep(2e-3)
        self._now_ns = max(self._now_ns, deadline_ns)


class EstimateSink:
    """Keeps what a session records of its estimation and its plans, but for the time at which it did."""

    def __init__(self) -> None:
        self.kept: list[tuple[str, str]] = []

    def write(self, topic: str, data: bytes, stamp_ns: int) -> None:
        wanted = {schemas.SLAM_STATE_TOPIC, schemas.SLAM_SURFACE_TOPIC, schemas.PLAN_TOPIC, schemas.DECISION_TOPIC}
        if topic in wanted:
            content = json.loads(data)
            del content["timestamp"]
            content.pop("seconds", None)
            self.kept.append((topic, json.dumps(content)))


class UndoesOnce(PolicyDecisions):
    """The policy's decisions, but the second grasp undone once."""

    undone_already = False

    def decide(self, index: int) -> Decision:
        if index == 2 and not self.undone_already:
            self.undone_already = True
            return UndoGrasp("to see what comes of it")
        return super().decide(index)


@dataclass
class Acts(NullProgress):
    """Does something in a phase of a grasp."""

    number: int = 0
    name: str = ""
    act: Callable[[], None] = lambda: None
    phases: list[str] = field(default_factory=list)

    def phase(self, number: int, name: str) -> None:
        if (number, name) == (self.number, self.name):
            self.act()


@dataclass
class Run:
    """One session on the disc."""

    clock: Any
    slam: TactileSlam
    grasps: int = 3
    policy: str | None = None

    def __post_init__(self) -> None:
        exploration = {} if self.policy is None else {"exploration": {"policy": self.policy}}
        content = {"grasps": self.grasps, "cycle": QUICK, "fixed_grasps": 1, **exploration}
        self.settings = validate(content, SessionSettings, where="test")
        self.world, self.sink = DiscWorld(Disc(np.array([0.005, -0.004]))), EstimateSink()
        self.world.clock, self.world.recorder = self.clock, Recorder(self.sink)  # type: ignore[assignment]
        self.roles: SessionRoles = autonomous_roles(self.world, self.slam, self.settings, seed=3)  # type: ignore[arg-type]

    def go(self, watcher: NullProgress | None = None) -> SessionOutcome:
        with self.roles.estimator:
            return Conductor(self.world, self.settings, self.roles, watcher).run()  # type: ignore[arg-type]

    @property
    def process(self) -> EstimatorProcess:
        assert isinstance(self.roles.estimator, EstimatorProcess)
        return self.roles.estimator


def slam() -> TactileSlam:
    return TactileSlam(SlamSettings(particles=200), seed=1)


def has_ended(process_id: int) -> bool:
    try:
        return Path(f"/proc/{process_id}/stat").read_text().rsplit(")", 1)[1].split()[0] == "Z"
    except FileNotFoundError:
        return True


# --- whole sessions -----------------------------------------------------------------------------------------------


def everything(clock: Any) -> tuple[list[tuple[str, str]], list[bytes], list[bytes], bytes, Any]:
    run = Run(clock, slam(), policy="clusters")
    decisions = UndoesOnce(run.roles.estimator, record_choices(run.world))  # type: ignore[arg-type]
    run.roles = replace(run.roles, decisions=decisions)
    outcome = run.go()
    assert outcome.ending is Ending.COMPLETE, outcome.reason
    chance, result = run.slam._rng.bit_generator.state, run.slam.finish()
    assert result.contour is not None
    contacts = [grasp.points_world_m.tobytes() + grasp.normals_world.tobytes() for grasp in outcome.grasps]
    poses = [pose.matrix().tobytes() for pose in result.world_T_object if pose is not None]
    return run.sink.kept, contacts, poses, result.contour.points_m.tobytes(), chance


@pytest.mark.long
def test_a_session_is_the_same_wherever_it_thinks() -> None:
    """With an undo, a policy that draws lots, and the final shape made of what came home."""
    here, there = everything(VirtualClock()), everything(BriefClock())
    assert len(here[0]) > 3 * 4
    assert len(here[1]) == len(here[2]) == 3
    assert here == there


@pytest.mark.usefixtures("quick_children")
def test_a_killed_process_ends_the_session_in_order_and_no_grasp_is_lost() -> None:
    run = Run(BriefClock(), slam())
    stops = run.world.hand.stops
    outcome = run.go(Acts(1, "lift", lambda: os.kill(run.process.process_id, signal.SIGKILL)))
    assert outcome.ending is Ending.STOPPED
    assert outcome.reason.startswith("estimation: its process has ended")
    assert isinstance(outcome.error, SessionError)
    assert not isinstance(outcome.error, DeviceError)
    assert run.world.hand.stops == stops + 1
    assert [cause.split(".")[0] for cause, _ in run.world.stop_reports] == ["estimation: its process has ended"]
    assert len(outcome.grasps) == 1
    estimate_rest(run.slam, outcome.grasps)
    assert run.slam.step_count == 1
    assert run.slam.world_T_object is not None


@pytest.mark.usefixtures("quick_children")
def test_ctrl_c_finishes_the_grasp_with_its_estimate() -> None:
    run = Run(BriefClock(), slam())
    outcome = run.go(Acts(1, "estimate", lambda: os.kill(os.getpid(), signal.SIGINT)))
    assert outcome.ending is Ending.INTERRUPTED
    assert run.slam.step_count == len(outcome.grasps) == 1
    assert [topic for topic, _ in run.sink.kept] == [
        schemas.PLAN_TOPIC,
        schemas.SLAM_STATE_TOPIC,
        schemas.SLAM_SURFACE_TOPIC,
    ]


@pytest.mark.usefixtures("quick_children")
def test_a_step_that_fails_ends_the_session_in_order_and_the_record_says_where() -> None:
    run = Run(VirtualClock(), questions.StumblingSlam(SlamSettings(particles=200), seed=1))
    assert isinstance(run.roles.estimator, LocalClient)
    outcome = run.go()
    assert outcome.ending is Ending.STOPPED
    assert isinstance(outcome.error, EstimationError)
    assert "program error in estimate (ZeroDivisionError: a bug)" in outcome.reason
    assert len(outcome.grasps) == 2
    assert any("questions.py" in text and "ZeroDivisionError" in text for _, text in run.world.log_lines)


# --- single questions ---------------------------------------------------------------------------------------------


class Idle:
    """Cycles of a session that waits; the next one fails when it is told to."""

    def __init__(self) -> None:
        self.cycles = 0
        self.error: BaseException | None = None

    def __call__(self) -> None:
        self.cycles += 1
        time.sleep(0.001)
        if self.error is not None:
            error, self.error = self.error, None
            raise error


@pytest.fixture(scope="module")
def idle() -> Idle:
    return Idle()


@pytest.fixture(scope="module")
def process(idle: Idle, support_is_found: None) -> Iterator[EstimatorProcess]:
    made = EstimatorProcess(Counting(slam()), idle)  # type: ignore[arg-type]
    with made:
        yield made


def ask(process: EstimatorProcess, question: Any, *args: Any) -> Any:
    return process.ask(question, *args)


def test_cycles_run_while_an_answer_is_awaited(process: EstimatorProcess, idle: Idle) -> None:
    ask(process, questions.counted)  # the process has started
    before = idle.cycles
    ask(process, questions.counted, 0.2)
    assert idle.cycles - before >= 20


def test_errors_come_through_as_they_are(process: EstimatorProcess) -> None:
    with pytest.raises(ShapeError, match=r"mesh: it has a hole\. Mend it") as caught:
        ask(process, questions.refused)
    assert caught.value.hint == "Mend it"


def test_a_bug_is_told_with_its_place_and_the_process_goes_on(process: EstimatorProcess) -> None:
    with pytest.raises(EstimationError, match="program error in stumbled") as caught:
        ask(process, questions.stumbled)
    assert any("questions.py" in note for note in caught.value.__notes__)
    assert isinstance(ask(process, questions.counted), int)


def test_questions_never_queue_up(process: EstimatorProcess, idle: Idle) -> None:
    """A device that fails ends the waiting; the next question waits for that answer too, and gets its own."""
    before = ask(process, questions.counted)
    for _ in range(3):
        idle.error = DeviceError("cable pulled", where="FF")
        with pytest.raises(DeviceError, match="cable pulled"):
            ask(process, questions.counted, 0.05)
    assert ask(process, questions.counted) - before in (2, 4)


def test_linear_algebra_has_one_thread(process: EstimatorProcess) -> None:
    assert set(ask(process, questions.algebra_threads)) == {1}


def test_a_session_that_is_killed_takes_its_process_along() -> None:
    """Though that is busy for long. What starts it stands for the session: it only holds the pipes."""
    script = """
import sys, time
from drivers.core.child_process import ChildProcess
child = ChildProcess("tactile_lab.autonomy.estimator_worker", "estimation")
child.start({"service": sys.argv[1]})
child.ready(120.0)
child.give({"question": sys.argv[2]})
print(child.process_id, flush=True)
time.sleep(600.0)
"""
    words = [pack(Counting(slam())), pack((questions.counted, (600.0,), {}))]
    command = [sys.executable, "-c", script, *words]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=REPOSITORY) as session:
        assert session.stdout is not None
        process_id = int(session.stdout.readline())
        assert not has_ended(process_id)
        session.kill()
    for _ in range(600):
        if has_ended(process_id):
            return
        time.sleep(0.05)
    os.kill(process_id, signal.SIGKILL)
    pytest.fail("the service's process outlives its session")


def test_a_session_that_ends_at_once_does_not_wait_for_a_step(process: EstimatorProcess, idle: Idle) -> None:
    """The last of these: it ends their process."""
    process_id, idle.error = process.process_id, KeyboardInterrupt()
    with pytest.raises(KeyboardInterrupt):
        ask(process, questions.counted, 600.0)
    process.__exit__(KeyboardInterrupt, KeyboardInterrupt(), None)
    assert has_ended(process_id)
