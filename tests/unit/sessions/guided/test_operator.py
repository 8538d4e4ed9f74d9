"""Guided sessions on a world without physics: prompts, requests, undo, pause, failures, notes."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gtsam import Pose3

from drivers.core.configuration import validate
from sessions.conductor.conductor import Conductor
from sessions.conductor.session_outcome import Ending, SessionOutcome
from sessions.guided.operator import Ask, Panel, Request, Stage, Together, request_of
from sessions.guided.simulated_operator import Cue, SimulatedOperator
from sessions.recording.session_events import EventKind
from tactile_lab.autonomy.guided_roles import guided_roles
from tactile_lab.autonomy.settings import SessionSettings
from tactile_lab.slam.slam_settings import SlamSettings
from tactile_lab.slam.tactile_slam import TactileSlam
from tests.support.disc_world import Disc, DiscWorld

QUICK = {"squeeze_s": 0.1, "finger_rad_s": 20.0, "travel_m_s": 1.0, "turn_rad_s": 5.0}
QUICK |= {"landing_m_s": 0.05, "links_landing_m_s": 0.05}


def settings(grasps: int, **guided: Any) -> SessionSettings:
    content = {"grasps": grasps, "cycle": QUICK, "fixed_grasps": grasps, "guided": guided, "probing": {"top": False}}
    return validate(content, SessionSettings, where="test")


def disc() -> Disc:
    return Disc(np.array([0.005, -0.004]))


class Run:
    """One guided session on the disc."""

    def __init__(self, folder: Path, world: DiscWorld, operator: Any, grasps: int = 2, **guided: Any) -> None:
        self.world, self.operator, self.folder = world, operator, folder
        self.slam, wanted = TactileSlam(SlamSettings(particles=200), seed=1), settings(grasps, **guided)
        roles = guided_roles(world, self.slam, wanted, operator, folder, seed=3)  # type: ignore[arg-type]
        self.outcome: SessionOutcome = Conductor(world, wanted, roles).run()  # type: ignore[arg-type]

    @property
    def told(self) -> list[str]:
        return [text for _, text in self.world.log_lines]


def at(stage: Stage, grasp: int = 1, *, paused: bool = False) -> Callable[[Panel], bool]:
    return lambda panel: (panel.stage, panel.grasp, bool(panel.paused)) == (stage, grasp, paused)


def ask(kind: Ask, **details: Any) -> tuple[Request, ...]:
    return (Request(kind, **details),)


@pytest.fixture(scope="module")
def usual(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """A session of two grasps in which nothing happens that was not meant to; only to be looked at."""
    return Run(tmp_path_factory.mktemp("usual"), DiscWorld(disc()), SimulatedOperator())


def test_prompts_lead_through_every_grasp(usual: Run) -> None:
    assert usual.outcome.ending is Ending.COMPLETE
    stages = [panel.stage for panel in usual.operator.panels]
    order = [stage for n, stage in enumerate(stages) if n == 0 or stage is not stages[n - 1]]
    one = [Stage.PLACE, Stage.GUIDE, Stage.CLOSE, Stage.HOLD, Stage.CAPTURE]
    assert order[:8] == [*one, Stage.ROTATE, Stage.RELEASE, Stage.PLACE]
    assert all(panel.prompt for panel in usual.operator.panels if panel.stage is not Stage.ESTIMATE)
    prompts = list(dict.fromkeys(panel.prompt for panel in usual.operator.panels if panel.grasp == 1))
    guided = [prompt for prompt in prompts if prompt][1:]  # the first is about placing the object
    assert [prompt.split(".")[0] for prompt in guided[:9]] == [
        "Move the hand around the object",
        "Close the fingers",
        "Bringing the fingers to the contact force",
        "Hold still",
        "Capturing: hold still",
        "Considering how to turn the object",
        "Building up the squeeze",
        "Turn the object",
        "Releasing the object",
    ]


def test_what_a_request_does_not_say_is_no_step() -> None:
    move = Request(Ask.MOVE)
    assert (move.steps, move.x, move.y, move.z, move.turn) == (0, 0, 0, 0, 0)
    assert (move.fingers, move.text) == ((), "")


def test_guided_grasps_are_those_of_the_same_conductor(usual: Run) -> None:
    assert all(len(grasp.contacts) >= 4 for grasp in usual.outcome.grasps)
    closed = [
        EventKind.TARE,
        EventKind.CLOSE_BEGIN,
        EventKind.CAPTURE_BEGIN,
        EventKind.CAPTURE_END,
        EventKind.TRUTH_FRAME,
    ]
    assert usual.world.session_events == [*closed, EventKind.HOLD_BEGIN, EventKind.HOLD_END, *closed]


def test_sensors_are_put_into_words(usual: Run) -> None:
    holding = [panel for panel in usual.operator.panels if panel.stage is Stage.HOLD]
    assert holding[-1].view.is_steady
    assert "4 fingers touch" in holding[-1].view.words() or "5 fingers touch" in holding[-1].view.words()
    assert any("captured 5 contacts" in text or "captured 4 contacts" in text for text in usual.told)
    assert any("% of the surface is known" in panel.unknown for panel in usual.operator.panels)
    assert all(panel.suggestion for panel in usual.operator.panels)


def test_grasp_is_taken_back_and_the_estimate_with_it(tmp_path: Path) -> None:
    world = DiscWorld(disc())
    run = Run(tmp_path, world, SimulatedOperator([Cue(at(Stage.PLACE, 2), ask(Ask.UNDO))]))
    assert world.event_counts[EventKind.UNDO] == 1
    assert world.event_counts[EventKind.CAPTURE_END] == 3
    at_first = {panel.unknown for panel in run.operator.panels if panel.grasp == 1 and panel.stage is Stage.PLACE}
    assert at_first == {"the whole object is unknown"}
    assert [grasp.index for grasp in run.outcome.grasps] == [0, 1]
    again = TactileSlam(SlamSettings(particles=200), seed=1)
    for grasp in run.outcome.grasps:
        again.add_grasp(grasp)
    assert again.world_T_object is not None
    assert run.slam.world_T_object is not None
    np.testing.assert_array_equal(again.world_T_object.matrix(), run.slam.world_T_object.matrix())


def test_undo_after_the_capture_takes_this_grasp_back(tmp_path: Path) -> None:
    world = DiscWorld(disc())
    run = Run(tmp_path, world, SimulatedOperator([Cue(at(Stage.ROTATE, 1), ask(Ask.UNDO))]))
    assert world.event_counts[EventKind.UNDO] == 1
    assert len(run.outcome.grasps) == 2


@pytest.mark.parametrize("stage", [Stage.GUIDE, Stage.CLOSE, Stage.HOLD])
def test_closing_can_be_given_up_before_the_capture(tmp_path: Path, stage: Stage) -> None:
    world = DiscWorld(disc())
    run = Run(tmp_path, world, SimulatedOperator([Cue(at(stage, 1), ask(Ask.GIVE_UP))]), grasps=1)
    assert run.outcome.ending is Ending.COMPLETE
    assert "given up by the operator" in run.told
    assert world.event_counts[EventKind.CAPTURE_END] == 1


def test_hand_is_without_demand_while_the_session_pauses_between_grasps(tmp_path: Path) -> None:
    script = [Cue(at(Stage.PLACE, 2), ask(Ask.PAUSE)), Cue(at(Stage.PLACE, 2, paused=True), ask(Ask.PAUSE))]
    world = DiscWorld(disc())
    run = Run(tmp_path, world, SimulatedOperator(script))
    assert run.outcome.ending is Ending.COMPLETE
    assert world.hand.stops == 2  # the pause and the end
    assert world.hand.resumes == 1


def test_pause_in_the_hold_keeps_the_grasp_as_it_is(tmp_path: Path) -> None:
    script = [
        Cue(at(Stage.HOLD), ask(Ask.PAUSE)),
        Cue(at(Stage.HOLD, paused=True), ask(Ask.CAPTURE)),  # nothing happens in a pause
        Cue(at(Stage.HOLD, paused=True), ask(Ask.PAUSE)),
    ]
    world = DiscWorld(disc())
    run = Run(tmp_path, world, SimulatedOperator(script), grasps=1)
    assert run.outcome.ending is Ending.COMPLETE
    assert any(panel.message == "paused. p: resume" for panel in run.operator.panels)
    assert world.hand.stops == 1
    assert len(run.outcome.grasps[0].contacts) >= 4


def test_session_ends_when_asked_twice(tmp_path: Path) -> None:
    script = [Cue(at(Stage.PLACE, 2), ask(Ask.END)), Cue(at(Stage.PLACE, 2), ask(Ask.END))]
    run = Run(tmp_path, DiscWorld(disc()), SimulatedOperator(script), grasps=5)
    assert (run.outcome.ending, run.outcome.reason) == (Ending.COMPLETE, "ended by the operator after 1 grasps")


class Leaving(SimulatedOperator):
    """Plays the script and then asks for nothing any more."""

    def show(self, panel: Panel) -> None:
        if self._script:
            super().show(panel)


@pytest.mark.parametrize("stage", [Stage.GUIDE, Stage.CLOSE, Stage.HOLD, Stage.ROTATE])
def test_ctrl_c_ends_a_session_that_waits_for_its_person(tmp_path: Path, stage: Stage) -> None:
    leaving = Leaving([Cue(at(stage), act=lambda: os.kill(os.getpid(), signal.SIGINT))])
    run = Run(tmp_path, DiscWorld(disc()), leaving, grasps=3, attention_s=20.0)
    assert run.outcome.ending is Ending.INTERRUPTED
    assert len(run.outcome.grasps) == (stage is Stage.ROTATE)
    assert "interrupted by the operator" in run.told


@pytest.mark.parametrize("stage", [Stage.PLACE, Stage.HOLD])
def test_ctrl_c_ends_a_pause_and_the_session(tmp_path: Path, stage: Stage) -> None:
    interrupt = Cue(at(stage, paused=True), act=lambda: os.kill(os.getpid(), signal.SIGINT))
    leaving = Leaving([Cue(at(stage), ask(Ask.PAUSE)), interrupt])
    run = Run(tmp_path, DiscWorld(disc()), leaving, grasps=3, attention_s=20.0)
    assert (run.outcome.ending, run.outcome.grasps) == (Ending.INTERRUPTED, ())


def test_asking_once_for_the_end_and_then_for_another_thing_goes_on(tmp_path: Path) -> None:
    script = [Cue(at(Stage.PLACE), ask(Ask.END)), Cue(at(Stage.PLACE), ask(Ask.NEXT))]
    run = Run(tmp_path, DiscWorld(disc()), SimulatedOperator(script), grasps=1)
    assert len(run.outcome.grasps) == 1


def test_unattended_session_is_closed_in_order_after_its_time(tmp_path: Path) -> None:
    class Nobody(SimulatedOperator):
        def show(self, panel: Panel) -> None:
            self.panels.append(panel)

    run = Run(tmp_path, DiscWorld(disc()), Nobody(attended=True), attention_s=3.0)
    assert run.outcome.ending is Ending.COMPLETE
    assert "no input from the operator for 3 s" in run.told
    assert run.world.clock.now_ns() < 10e9


def test_steps_of_the_hand_and_the_fingers_lead_to_a_grasp(tmp_path: Path) -> None:
    """Nothing by itself: lowered step by step, closed finger by finger, each stops at its touch."""
    lowered: list[int] = []

    class Teleoperator(SimulatedOperator):
        def show(self, panel: Panel) -> None:
            self.panels.append(panel)
            if panel.stage is Stage.GUIDE and "tips 0 mm" not in panel.message:
                lowered.append(1)
                self._waiting.append(Request(Ask.MOVE, z=-1))
            elif panel.stage is Stage.CLOSE and len(panel.view.touching) < 5:
                fingers = tuple(f for f in panel.view.forces_N if f not in panel.view.touching)
                self._waiting.append(Request(Ask.FINGERS, fingers=fingers, steps=1))
            elif panel.stage in (Stage.PLACE, Stage.GUIDE, Stage.CLOSE):
                self._waiting.append(Request(Ask.NEXT))
            elif panel.stage is Stage.HOLD and panel.view.is_steady:
                self._waiting.append(Request(Ask.CAPTURE))

    run = Run(tmp_path, DiscWorld(disc()), Teleoperator(), grasps=1)
    assert len(lowered) >= 20  # 100 mm in steps of 5 mm
    assert len(run.outcome.grasps[0].contacts) == 5
    assert max(contact.force_N for contact in run.outcome.grasps[0].contacts) < 3.0


def test_hand_goes_back_where_a_step_meets_something(tmp_path: Path) -> None:
    """The disc is far too wide: the fingers would stand on it."""

    class Lower(SimulatedOperator):
        def show(self, panel: Panel) -> None:
            self.panels.append(panel)
            if "touched something" in panel.message:
                self._waiting += [Request(Ask.END), Request(Ask.END)]
            elif panel.stage is Stage.GUIDE:
                self._waiting.append(Request(Ask.MOVE, z=-1))
            elif panel.stage is Stage.PLACE:
                self._waiting.append(Request(Ask.NEXT))

    run = Run(tmp_path, DiscWorld(Disc(np.zeros(2), radius_m=0.12, height_m=0.04)), Lower())
    assert any("touched something: moved back by one step" in text for text in run.told)
    assert run.outcome.ending is Ending.COMPLETE
    assert not run.outcome.grasps


def test_a_capture_with_no_finger_in_contact_is_asked_for_twice(tmp_path: Path) -> None:
    world, captured = DiscWorld(disc()), list[int]()

    class Hasty(SimulatedOperator):
        def show(self, panel: Panel) -> None:
            if panel.stage is Stage.HOLD:
                captured.append(world.event_counts[EventKind.CAPTURE_BEGIN])
            if panel.stage in (Stage.CLOSE, Stage.HOLD):
                self._waiting.append(Request(Ask.CAPTURE if panel.stage is Stage.HOLD else Ask.NEXT))
            else:
                super().show(panel)

    run = Run(tmp_path, world, Hasty(), grasps=1)
    assert "no finger is in contact. Ask again to capture all the same" in run.told
    assert len(captured) > 1, "asked once, and nothing was captured"
    assert not any(captured)
    assert world.event_counts[EventKind.CAPTURE_END] == 1


def test_captures_come_by_themselves_when_automatic(tmp_path: Path) -> None:
    class Lazy(SimulatedOperator):
        def show(self, panel: Panel) -> None:
            if panel.stage is not Stage.HOLD:
                super().show(panel)

    run = Run(tmp_path, DiscWorld(disc()), Lazy(), automatic=True)
    assert len(run.outcome.grasps) == 2


def test_notes_markers_and_files_are_kept(tmp_path: Path) -> None:
    photo = tmp_path / "side view.jpg"
    photo.write_bytes(b"picture")
    session = tmp_path / "session"
    session.mkdir()
    requests = (
        Request(Ask.NOTE, text="slipped a\nlittle"),
        Request(Ask.MARKER, text="bump"),
        Request(Ask.ATTACH, text=str(photo)),
        Request(Ask.ATTACH, text=str(photo)),
        Request(Ask.ATTACH, text=str(tmp_path)),
        Request(Ask.ATTACH, text=str(tmp_path / "missing.jpg")),
        Request(Ask.PHOTO),
    )
    run = Run(session, DiscWorld(disc()), SimulatedOperator([Cue(at(Stage.GUIDE), requests)]), grasps=1)
    kept = session / "attachments"
    assert (kept / "notes.txt").read_text() == "slipped a little\n"
    assert sorted(path.name for path in kept.iterdir()) == ["notes.txt", "side view-2.jpg", "side view.jpg"]
    assert {"marker 1 bump", "attached side view.jpg", "attached side view-2.jpg"} <= set(run.told)
    assert any("not a file" in text for text in run.told)
    assert any("No such file" in text for text in run.told)
    assert any(panel.message == "this rig has no camera" for panel in run.operator.panels)


def test_hand_fails_and_the_session_goes_on_after_it_is_mended(tmp_path: Path) -> None:
    world = DiscWorld(disc())

    def cut() -> None:
        world.silent = True

    def mend() -> None:
        world.silent = False

    script = [
        Cue(at(Stage.CLOSE, 2), act=cut),
        Cue(lambda panel: "no new status" in panel.paused, act=mend),
    ]
    run = Run(tmp_path, world, SimulatedOperator(script, attended=True))
    assert run.outcome.ending is Ending.COMPLETE
    assert len(run.outcome.grasps) == 2
    assert any("stopped: hand: no new status" in text for text in run.told)


def test_failure_ends_a_session_with_nobody_there(tmp_path: Path) -> None:
    world = DiscWorld(disc())

    def cut() -> None:
        world.silent = True

    run = Run(tmp_path, world, SimulatedOperator([Cue(at(Stage.CLOSE, 2), act=cut)]))
    assert run.outcome.ending is Ending.STOPPED
    assert len(run.outcome.grasps) == 1


class Hands(SimulatedOperator):
    """Leads the hand by hand: moves the world itself, as a person moves the arm."""

    def __init__(self, world: DiscWorld) -> None:
        super().__init__()
        self._world, self._autonomous = world, _palm_and_fingers(world)

    def show(self, panel: Panel) -> None:
        if panel.stage is Stage.GUIDE:
            self._world.base_q, self._world.joints_rad = (self._autonomous[0].copy(), self._autonomous[1].copy())
        elif panel.stage is Stage.CLOSE:
            self._world.joints_rad = self._autonomous[2].copy()
        elif panel.stage is Stage.RELEASE:
            self._world.joints_rad = self._autonomous[1].copy()
        super().show(panel)


def _palm_and_fingers(world: DiscWorld) -> tuple[Any, Any, Any]:
    """Where an autonomous session puts palm and fingers: base and joints open, joints closed."""
    seen: list[tuple[Any, Any]] = []
    events: list[EventKind] = []

    def look(copy: DiscWorld) -> None:
        if (
            copy.session_events
            and copy.session_events[-1] in (EventKind.CLOSE_BEGIN, EventKind.CAPTURE_BEGIN)
            and copy.session_events != events
        ):
            events[:] = copy.session_events
            seen.append((copy.base_q.copy(), copy.joints_rad.copy()))

    assert world.disc is not None
    copy = DiscWorld(Disc(world.disc.centre_m.copy()), look)
    with pytest.MonkeyPatch.context():
        Run(Path("/nowhere"), copy, SimulatedOperator(), grasps=1)
    (base_q, opened), (_, closed) = seen[:2]
    return base_q, opened, closed


def test_hand_led_by_hand_is_only_watched(tmp_path: Path) -> None:
    world = DiscWorld(disc())
    run = Run(tmp_path, world, Hands(world), led_by="hand")
    assert run.outcome.ending is Ending.COMPLETE
    assert all(len(grasp.contacts) >= 4 for grasp in run.outcome.grasps)
    prompts = {panel.stage: panel.prompt for panel in run.operator.panels}
    assert "zero the fingertips" in prompts[Stage.GUIDE]
    assert "Close the fingers around the object by hand" in prompts[Stage.CLOSE]
    assert isinstance(run.outcome.grasps[1].hand_motion_world, Pose3)
    assert world.event_counts[EventKind.HOLD_BEGIN] == world.event_counts[EventKind.HOLD_END] == 1
    assert world.times_led == 5  # guided twice, turned once, opened twice
    assert not world.led_at_capture
    assert not world.is_led


def test_everyone_at_a_session_is_heard_and_shown() -> None:
    one, other = SimulatedOperator(), SimulatedOperator(attended=True)
    both = Together(one, other)
    one._waiting.append(Request(Ask.PAUSE))
    other._waiting.append(Request(Ask.MARKER))
    assert both.attended
    assert [request.ask for request in both.requests()] == [Ask.PAUSE, Ask.MARKER]


@pytest.mark.parametrize("content", [{}, {"ask": "fly"}, {"ask": "note", "text": 3}])
def test_strange_requests_are_refused(content: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=r"."):
        request_of(content)
