"""Guided sessions in a world of discs, request by request: what is shown, told and done, compared with before."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from drivers.core.clock import VirtualClock
from drivers.core.configuration import validate
from drivers.core.contacts import FINGERS
from drivers.core.errors import SafetyError, TactileLabError
from sessions.conductor.conductor import Conductor
from sessions.conductor.guided_settings import GuidedSettings
from sessions.guided.operator import Ask, Panel, Request, Stage, Together, request_of
from sessions.guided.operator_view import OperatorView, Watcher
from sessions.guided.pace import Pace
from sessions.guided.simulated_operator import Cue, SimulatedOperator
from sessions.guided.words import plan_in_words
from sessions.motion.grasp_frame import GraspFrame
from sessions.motion.grasp_plan import GraspPlan
from sessions.recording.attachments import Attachments
from tactile_lab.autonomy.guided_roles import guided_roles
from tactile_lab.autonomy.settings import SessionSettings
from tactile_lab.slam.slam_settings import SlamSettings
from tactile_lab.slam.tactile_slam import TactileSlam
from tests.support.baseline import assert_baseline
from tests.support.disc_world import BaseState, Disc, DiscWorld, Reading
from tests.support.motion_trace import TracedWorld
from tests.support.session_fakes import make_perception

BRISK = {"squeeze_s": 0.2, "finger_rad_s": 6.0, "travel_m_s": 0.6, "turn_rad_s": 4.0, "lift_m": 0.05}
BRISK |= {"landing_m_s": 0.05, "links_landing_m_s": 0.05}


def at(stage: Stage, *requests: Request, grasp: int | None = None) -> Cue:
    """Requests for the next panel of a stage."""
    return Cue(lambda panel: panel.stage is stage and grasp in (None, panel.grasp) and bool(panel.prompt), requests)


def paused(*requests: Request) -> Cue:
    return Cue(lambda panel: bool(panel.paused), requests)


def asks(*kinds: Ask) -> tuple[Request, ...]:
    return tuple(Request(kind) for kind in kinds)


def move(**steps: int) -> Request:
    return Request(Ask.MOVE, **steps)


def fingers(steps: int, *names: str) -> Request:
    return Request(Ask.FINGERS, fingers=names or FINGERS, steps=steps)


BY_STEPS = (
    at(Stage.GUIDE, *asks(Ask.NEXT), move(z=-1), move(x=1, y=-1, turn=1), move(z=-4), *asks(Ask.NEXT)),
    at(Stage.GUIDE, move(z=-8), *asks(Ask.CAPTURE)),
    at(
        Stage.CLOSE,
        fingers(3),
        fingers(8, "FF", "TH", "XX"),
        fingers(-2, "FF"),
        fingers(9),
        fingers(4),
        *asks(Ask.NEXT),
    ),
    at(
        Stage.HOLD, Request(Ask.NOTE, text="a  note\nof two lines"), Request(Ask.MARKER, text="here"), *asks(Ask.MARKER)
    ),
    at(Stage.HOLD, *asks(Ask.PHOTO), Request(Ask.ATTACH, text="/no/such/file"), *asks(Ask.AUTOMATIC, Ask.AUTOMATIC)),
    at(Stage.HOLD, *asks(Ask.PAUSE)),
    paused(Request(Ask.MOVE), *asks(Ask.PAUSE)),
    at(Stage.HOLD, *asks(Ask.END, Ask.NOTE, Ask.CAPTURE)),
    at(Stage.ROTATE, move(turn=2, x=1), *asks(Ask.GIVE_UP, Ask.NEXT)),
    at(Stage.PLACE, *asks(Ask.NEXT), grasp=2),
    at(Stage.GUIDE, *asks(Ask.GO), grasp=2),
    at(Stage.CLOSE, *asks(Ask.GO), grasp=2),
    at(Stage.HOLD, *asks(Ask.UNDO), grasp=2),
    at(Stage.PLACE, *asks(Ask.UNDO), grasp=2),
    at(Stage.PLACE, Request(Ask.PAUSE, text="coffee"), grasp=1),
    paused(*asks(Ask.PAUSE)),
    at(Stage.PLACE, *asks(Ask.NEXT), grasp=1),
    at(Stage.GUIDE, *asks(Ask.GO), grasp=1),
    at(Stage.CLOSE, *asks(Ask.GO), grasp=1),
    at(Stage.HOLD, *asks(Ask.AUTOMATIC), grasp=1),
    at(Stage.ROTATE, *asks(Ask.GO), grasp=1),
    at(Stage.PLACE, *asks(Ask.END), grasp=2),
    at(Stage.PLACE, *asks(Ask.END), grasp=2),
)
BY_HAND = (
    at(Stage.GUIDE, *asks(Ask.NEXT)),
    at(Stage.CLOSE, *asks(Ask.NEXT)),
    at(Stage.HOLD, *asks(Ask.CAPTURE)),
    at(Stage.HOLD, *asks(Ask.CAPTURE)),
    at(Stage.ROTATE, *asks(Ask.NEXT)),
    at(Stage.RELEASE, *asks(Ask.NEXT)),
    at(Stage.GUIDE, *asks(Ask.GIVE_UP)),
    at(Stage.RELEASE, *asks(Ask.GO)),
    at(Stage.PLACE, *asks(Ask.PAUSE)),
    paused(*asks(Ask.PAUSE)),
    at(Stage.GUIDE, *asks(Ask.GO)),
    at(Stage.CLOSE, *asks(Ask.GO)),
    at(Stage.HOLD, *asks(Ask.NEXT)),
    at(Stage.HOLD, *asks(Ask.NEXT)),
    at(Stage.RELEASE, *asks(Ask.GO)),
)


@pytest.mark.parametrize(("led_by", "script"), [("keys", BY_STEPS), ("hand", BY_HAND)])
def test_a_guided_session(led_by: str, script: tuple[Cue, ...], tmp_path: Path) -> None:
    world = TracedWorld(Disc(np.array([0.005, -0.004])))
    operator = SimulatedOperator(script)
    guided = {"led_by": led_by, "panel_s": 0.05, "attention_s": 60.0}
    plain = {"fixed_grasps": 2, "probing": {"top": False}}
    wanted = validate({"grasps": 2, "cycle": BRISK, "guided": guided, **plain}, SessionSettings, where="test")
    slam = TactileSlam(SlamSettings(method="odometry"), seed=1)
    roles = guided_roles(world, slam, wanted, operator, tmp_path, seed=3)  # type: ignore[arg-type]
    outcome = Conductor(world, wanted, roles).run()  # type: ignore[arg-type]
    shown = [_brief(panel) for panel in operator.panels]
    told = {
        "outcome": [str(outcome.ending), outcome.reason, len(outcome.grasps)],
        "panels": len(shown),
        "shown": [one for n, one in enumerate(shown) if n == 0 or one != shown[n - 1]],
        "told": [[int(level), words.replace("-0.00", "0.00")] for level, words in world.log_lines],
        "led": [world.times_led, world.hand.stops, world.base.stops, world.hand.resumes],
        "notes": {path.name: path.read_text() for path in sorted((tmp_path / "attachments").glob("*"))},
        "trace": world.summary(),
    }
    assert_baseline(f"sessions/guided/{led_by}", told, rtol=1e-5, atol=1e-8)


def _brief(panel: Panel) -> list[Any]:
    content = panel.content()
    content["message"] = content["message"].replace("-0.00", "0.00")  # a disc turns unseen: zero but for rounding
    return [content[key] for key in ("grasp", "stage", "prompt", "capture", "message", "paused", "automatic", "asks")]


def test_requests_and_several_operators() -> None:
    told: dict[str, Any] = {}
    for name, content in {
        "a note": {"ask": "note", "text": "x" * 2001},
        "no ask": {},
        "a number": {"ask": "note", "text": 5},
    }.items():
        try:
            told[name] = str(request_of(content))[:60], len(request_of(content).text)
        except ValueError as error:
            told[name] = str(error)
    one, other = SimulatedOperator(), SimulatedOperator(attended=True)
    both = Together(one, other)
    both.show(Panel(0, 1, Stage.PLACE, "Place it", OperatorView({})))
    told["both"] = [
        both.attended,
        Together(one).attended,
        [str(request.ask) for request in both.requests()],
        len(other.panels),
    ]
    told["plans"] = [
        plan_in_words(GraspPlan(GraspFrame(0.0124, -0.02, 0.5), "pinch", 0.0305, reason))
        for reason in ("", "it is new")
    ]
    view = OperatorView({"FF": 0.5, "TH": None}, touching=("FF", "TH"))
    told["words"] = [view.words(), OperatorView({}).words()]
    assert_baseline("sessions/guided/words", told)


CHANGES: dict[int, tuple[tuple[str, Any, float], ...]] = {
    10: (("forces", (0, 2), 0.4), ("forces", (1, 2), 0.4)),
    20: (("forces", (0, 2), 0.149),),
    25: (("forces", (0, 2), 0.02),),
    30: (("base", 0, 0.00199),),
    35: (("base", 0, 0.0001),),
    40: (("joints", 3, 0.0348),),
    45: (("joints", 3, 0.0002),),
    50: (("forces", (1, 2), np.inf),),
    55: (("forces", (2, 2), 0.4),),
}
"""By the number of the cycle: what grows, and by how much."""


def test_when_a_grasp_is_steady() -> None:
    """A change of the fingers, forces, palm or joints, at the limit and beyond it, begins the measurement again."""
    seen = make_perception()
    settings = GuidedSettings(least_contacts=2, steady_s=0.05)
    watcher, told = Watcher(seen, settings, 0.15), list[Any]()
    joints, base = np.full(24, 0.3), np.array([0.0, 0.1, 0.2, 0.5, 0.0, 0.1])
    forces = np.zeros((5, 3))

    def cycle(now_ns: int) -> None:
        seen.on_hand(Reading(now_ns, joints.copy()))
        seen.on_base(BaseState(now_ns, base.copy()))
        for force, finger in zip(forces, FINGERS, strict=True):
            seen.on_wrench(finger, [force.copy()])
        watcher.take(now_ns)
        view = watcher.view(now_ns)
        told.append([view.touching, view.steady_s, view.is_steady, view.silent, list(view.forces_N.values())])

    for at_cycle in range(60):
        for values, where, step in CHANGES.get(at_cycle, ()):
            {"forces": forces, "base": base, "joints": joints}[values][where] += step
        cycle(10_000_000 * at_cycle)
    assert_baseline("sessions/guided/steady", {"told": told[::2]}, rtol=1e-6)


class Stopwatch(VirtualClock):
    """Keeps how long was waited for."""

    def __init__(self) -> None:
        super().__init__()
        self.slept: list[int] = []

    def sleep_until_ns(self, deadline_ns: int) -> None:
        self.slept.append(deadline_ns - self.now_ns())
        super().sleep_until_ns(deadline_ns)


def test_simulated_time_waits_for_real_time() -> None:
    told = {}
    for factor in (1.0, 4.0):
        clock, ms = Stopwatch(), 1_000_000
        pace = Pace(clock, factor)
        for at_ms, busy_ms in ((0, 0), (10, 3), (20, 15), (30, 190), (40, 2), (50, 205), (60, 0), (70, 1), (200, 0)):
            VirtualClock.sleep_until_ns(clock, clock.now_ns() + busy_ms * ms)
            pace(at_ms * ms)
        told[f"factor {factor}"] = [clock.slept, clock.now_ns()]
    assert_baseline("sessions/guided/pace", told)


def test_what_a_person_adds_to_a_session(tmp_path: Path) -> None:
    attachments, told = Attachments(tmp_path / "session"), list[Any]()
    (tmp_path / "session").mkdir()
    (tmp_path / "drawing.txt").write_text("a drawing")
    (tmp_path / "large.bin").touch()
    with (tmp_path / "large.bin").open("r+b") as file:
        file.truncate(50_000_001)
    acts = (
        *(lambda: attachments.note(" one \n two"), lambda: attachments.note("three")),
        *(lambda: attachments.file(str(tmp_path / "drawing.txt")),) * 3,
        *(lambda: attachments.file(str(tmp_path)), lambda: attachments.file(str(tmp_path / "large.bin"))),
        *(
            lambda: attachments.file(str(tmp_path / "none")),
            lambda: attachments.picture("a", b"\x89PNG\r\n\x1a\n"),
        ),
    )
    for act in acts:
        try:
            told.append(act())
        except TactileLabError as error:
            told.append(str(error).replace(str(tmp_path), ""))
    found = {path.name: path.stat().st_size for path in sorted(attachments.folder.iterdir()) if path.suffix != ".png"}
    assert_baseline("sessions/guided/attachments", {"told": told, "found": found})


def test_a_failure_ends_a_session_that_nobody_attends(tmp_path: Path) -> None:
    """One that somebody attends is paused, and goes on when he says so."""

    told = {}
    for attended in (False, True):
        failures = [SafetyError("too hard", where="FF", hint="Look")]

        def fail(world: DiscWorld, failures: list[SafetyError] = failures) -> None:
            if world.cycles == 200 and failures:
                raise failures.pop()

        world = TracedWorld(Disc(np.array([0.005, -0.004])), fail)
        operator = SimulatedOperator(attended=attended)
        content = {"grasps": 1, "cycle": BRISK, "guided": {}, "probing": {"top": False}}
        wanted = validate(content, SessionSettings, where="test")
        slam = TactileSlam(SlamSettings(method="odometry"), seed=1)
        roles = guided_roles(world, slam, wanted, operator, tmp_path, seed=3)  # type: ignore[arg-type]
        outcome = Conductor(world, wanted, roles).run()  # type: ignore[arg-type]
        told[f"attended: {attended}"] = {
            "outcome": [str(outcome.ending), outcome.reason],
            "told": [[int(level), words] for level, words in world.log_lines],
            "stops": [world.stop_reports, world.hand.stops, world.base.stops, world.base.resumes],
            "paused": sorted({panel.paused for panel in operator.panels}),
            "cycles": world.cycles,
        }
    assert_baseline("sessions/guided/failures", told)
