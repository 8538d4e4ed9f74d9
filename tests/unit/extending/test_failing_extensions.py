"""An extension that raises or answers NaN is named with its file, and costs what it was to give and nothing else."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from drivers.core.configuration import validate
from drivers.core.errors import ConfigurationError
from drivers.core.extensions import load_extension
from sessions.conductor.conductor import Conductor
from sessions.conductor.progress import NullProgress
from sessions.exchange.contact_log import ContactLog, MotionSigma, ObjectTruth, write_contact_log
from sessions.recording.recorder import Level, Recorder
from sessions.recording.session import Session
from sessions.recording.traffic import schemas
from tactile_lab.autonomy.settings import SessionSettings
from tactile_lab.cli.app import app
from tactile_lab.cli.main import main
from tactile_lab.evaluation.evaluation import Evaluation
from tactile_lab.experiments.data import planar_data
from tactile_lab.slam.exploration.policies import make_policy
from tactile_lab.slam.slam_settings import SlamSettings
from tactile_lab.slam.tactile_slam import TactileSlam
from tactile_lab.workflow.attending import Attendance, roles_for
from tactile_lab.workflow.reconstructing import Wishes, reconstruct_log
from tests.support.disc_world import Disc, DiscWorld
from tests.support.extending_page import Written
from tests.support.low_rig import low_rig

POLICY = """
import numpy as np
from tactile_lab.slam.exploration.policies import POLICIES
from tactile_lab.slam.exploration.policy import Decision

class Mine:
    name = "mine"

    def choose(self, candidates, belief, rng):
        {answer}

POLICIES.register("mine", Mine)
"""
SHAPE = """
import numpy as np
from tactile_lab.slam.shape.selection.models import SHAPE_MODELS
from tactile_lab.slam.shape.surfaces.surface import Contour

class Mine:
    name, log_evidence = "mine", None

    def contour(self, resolution_m=0.001):
        {answer}

SHAPE_MODELS.register("mine", lambda gpis, free_points_m, floor_m: Mine())
"""
FIGURE = """
from tactile_lab.evaluation.figures import FIGURES

def mine(judged):
    {answer}

FIGURES.register("mine", mine)
"""
COMMAND = """
from tactile_lab.cli.commands import COMMANDS

def mine() -> None:
    {answer}

COMMANDS.register("mine", mine)
"""
_NOT_FINITE = "gives points or standard deviations that are not finite"


class Sink:
    """Keeps the decisions."""

    def __init__(self) -> None:
        self.outcomes: list[str] = []

    def write(self, topic: str, data: bytes, stamp_ns: int) -> None:
        if topic == schemas.DECISION_TOPIC:
            self.outcomes.append(json.loads(data)["outcome"])


def session_with(policy: str, folder: Path, decisions: int) -> tuple[DiscWorld, Sink]:
    """A session whose grasps after the first are chosen by a policy."""
    quick = {"landing_force_N": 0.25, "squeeze_s": 0.1, "finger_rad_s": 20.0, "travel_m_s": 1.0, "turn_rad_s": 5.0}
    content = {"grasps": 1 + decisions, "cycle": quick, "fixed_grasps": 1, "exploration": {"policy": policy}}
    settings = validate(content, SessionSettings, where="test")
    world, sink = DiscWorld(Disc(np.array([0.005, -0.004]))), Sink()
    world.recorder = Recorder(sink)  # type: ignore[assignment]
    slam = TactileSlam(SlamSettings(), seed=1)
    roles = roles_for(Attendance(), world, slam, settings, folder, seed=3, dimension=2)  # type: ignore[arg-type]
    outcome = Conductor(world, settings, roles, NullProgress()).run()  # type: ignore[arg-type]
    assert (outcome.error, len(outcome.grasps)) == (None, 1 + decisions)
    return world, sink


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        ("raise RuntimeError('out of\\n ideas')", r"raises RuntimeError: out of ideas \(line 10\)"),
        ("raise SystemExit(5)", r"raises SystemExit: 5 \(line 10\)"),
        ("return Decision('mine', 'grasp', 0, (float('nan'),) * len(candidates), 'why')", "answers NaN"),
        pytest.param(
            "return Decision('mine', 'grasp', 0, (0.0,) * len(candidates), 'why', np.nan)",
            "answers NaN",
            marks=pytest.mark.long,
        ),
        pytest.param(
            "return Decision('mine', 'grasp', len(candidates), (0.0,) * len(candidates), 'why')",
            "and chooses",
            marks=pytest.mark.long,
        ),
        pytest.param(
            "return Decision('mine', 'grasp', None, (0.0,) * len(candidates), 'why')",
            "and chooses None",
            marks=pytest.mark.long,
        ),
        ("return Decision('mine', 'wait', None, (0.0,) * len(candidates), 'why')", "'wait' where grasp, stop, nothing"),
        pytest.param("return Decision('mine', 'grasp', 0, (), 'why')", "scores 0 of", marks=pytest.mark.long),
        ("return 0", "returned int instead of a Decision"),
    ],
)
def test_a_session_goes_on_by_the_heuristic_planner_when_its_policy_fails(
    written: Written, tmp_path: Path, answer: str, words: str
) -> None:
    path = written("mine.py", POLICY.format(answer=answer))
    load_extension(path)
    decisions = 2 if answer.startswith("raise") else 1  # once is enough to see the others refused
    world, sink = session_with("mine", tmp_path, decisions)
    assert sink.outcomes == ["nothing"] * decisions
    warnings = [message for level, message in world.log_lines if level is Level.WARNING]
    assert len(warnings) == decisions
    assert all(f"the policy mine of {path}" in message for message in warnings)
    assert re.search(words, warnings[0])


def test_a_policy_that_cannot_be_made_is_refused_before_the_session(written: Written) -> None:
    text = POLICY.format(answer="pass").replace('name = "mine"', "name = 1 / 0").replace("class Mine:", "def Mine():")
    text = text.replace("    def choose(self, candidates, belief, rng):\n        pass\n", "")
    load_extension(written("mine.py", text))
    words = r"mine\.py: the policy 'mine' cannot be made: ZeroDivisionError.*\(line 7\)"
    with pytest.raises(ConfigurationError, match=words):
        make_policy("mine")


def test_a_policy_bears_the_name_it_is_registered_with(written: Written) -> None:
    load_extension(written("mine.py", POLICY.format(answer="pass").replace('name = "mine"', 'name = "yours"')))
    with pytest.raises(ConfigurationError, match=r"mine\.py: the policy registered as 'mine' calls itself 'yours'"):
        make_policy("mine")


# --- results -------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def contact_log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A log of contacts on a rectangle with its truth."""
    data = planar_data.simulate("rectangle", 3, count=6)
    truth = ObjectTruth(name="rectangle", polygon_m=tuple(map(tuple, data.outline_m.tolist())))
    motion = MotionSigma(translation_m=0.01, rotation_rad=0.35)
    path = tmp_path_factory.mktemp("logs") / "rectangle.json"
    write_contact_log(path, ContactLog(2, 0.001, 0.09, motion, data.grasps, truth, data.world_T_body))
    return path


def judged(log: Path, out: Path, shape: str | None = None) -> Evaluation:
    finished = reconstruct_log(log, Wishes(method="known-pose", shape=shape), out)
    assert finished.evaluation is not None, finished.problem
    return finished.evaluation


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        ("raise ValueError('too few')", r"raises ValueError: too few (line 10)"),
        ("raise SystemExit(5)", r"raises SystemExit: 5 (line 10)"),
        (
            "return Contour(np.full((9, 2), np.nan), np.ones(9), True)",
            _NOT_FINITE,
        ),
        (
            "return Contour(np.ones((9, 2)), np.full(9, np.nan), True)",
            _NOT_FINITE,
        ),
        ("return None", "returned NoneType instead of Contour"),
    ],
)
def test_a_shape_model_that_fails_leaves_the_trajectory(
    written: Written, contact_log: Path, tmp_path: Path, answer: str, words: str
) -> None:
    path = written("mine.py", SHAPE.format(answer=answer))
    load_extension(path)
    evaluation = judged(contact_log, tmp_path / "out", "mine")
    assert (evaluation.shape, evaluation.status != "lost", evaluation.grasps) == (None, True, 6)
    warning = next(text for text in evaluation.warnings if "mine" in text)
    assert warning.startswith(f"no shape, as the shape model mine of {path} {words}")
    assert json.loads((tmp_path / "out" / "slam.json").read_text())["warnings"] == [warning]


def test_contacts_that_do_not_make_a_shape_are_no_failure_of_its_model(
    written: Written, contact_log: Path, tmp_path: Path
) -> None:
    text = SHAPE.format(answer="raise ShapeError('encloses nothing')")
    load_extension(written("mine.py", "from drivers.core.errors import ShapeError\n" + text))
    evaluation = judged(contact_log, tmp_path / "out", "mine")
    assert evaluation.warnings == ("no closed shape could be estimated from the contacts",)
    assert "warnings" not in json.loads((tmp_path / "out" / "slam.json").read_text())


@pytest.fixture(scope="module")
def without(contact_log: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What is judged without the figure."""
    return judged(contact_log, tmp_path_factory.mktemp("without") / "out").as_json()


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        ("raise KeyError('steps')", "raises KeyError: 'steps' (line 5)"),
        ("raise SystemExit(5)", "raises SystemExit: 5 (line 5)"),
        ("return float('nan')", "is not a finite number"),
        ("return {'a': 1.0, 'b': [2.0, float('inf')]}", "is not a finite number"),
        ("return object()", "raises TypeError: cannot convert object to plain data"),
    ],
)
def test_a_figure_that_fails_is_null_and_the_others_are_there(
    written: Written, contact_log: Path, without: dict[str, Any], tmp_path: Path, answer: str, words: str
) -> None:
    path = written("mine.py", FIGURE.format(answer=answer))
    load_extension(path)
    evaluation = judged(contact_log, tmp_path / "out")
    told = json.loads((tmp_path / "out" / "evaluation.json").read_text())
    assert told["further"] == {"mine": None}
    assert evaluation.warnings[-1] == f"no mine, as the evaluation figure mine of {path} {words}"
    assert "further" not in without
    assert {key: value for key, value in told.items() if key not in {"further", "warnings", "time"}} == {
        key: value for key, value in without.items() if key not in {"warnings", "time"}
    }


def test_a_figure_of_an_extension_never_replaces_one_of_ours(written: Written) -> None:
    text = FIGURE.format(answer="return 0.0").replace('"mine"', '"registration_rms_mm"')
    with pytest.raises(ConfigurationError, match=r"'registration_rms_mm', a name already used by .*figures\.py"):
        load_extension(written("mine.py", text))


def test_a_command_that_fails_ends_with_its_file(written: Written, capsys: pytest.CaptureFixture[str]) -> None:
    path = written("mine.py", COMMAND.format(answer="raise OSError('disk on fire')"))
    code, told = ended(capsys, "--extension", path, "mine")
    assert code == 1
    assert "mine.py: this extension failed: OSError: disk on fire (line 5)" in told


FINGERTIP = """
from drivers.fingertips.nano17 import Nano17Kind
from drivers.fingertips.kinds import FINGERTIPS
from drivers.ati.nano17 import Nano17
from drivers.simulation.fingertips import SIMULATED_FINGERTIPS

class Mine(Nano17):
    def load_N(self, world_R_distal):
        {answer}

class Kind(Nano17Kind):
    packaged = ""

    def device(self, finger, calibration, settings, link, clock, wire):
        return Mine(finger, link, clock, calibration, settings, wire)

FINGERTIPS.register("mine", Kind())
SIMULATED_FINGERTIPS.register("mine", SIMULATED_FINGERTIPS["nano17"])
"""


def ended(capsys: pytest.CaptureFixture[str], *words: object) -> tuple[object, str]:
    """Exit code and what is told people by a command that ends."""
    with pytest.raises(SystemExit) as ending:
        main([str(word) for word in words])
    return ending.value.code, " ".join(capsys.readouterr().err.split())


def test_a_driver_that_raises_is_named_and_the_session_is_kept(
    written: Written, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = written("mine.py", FINGERTIP.format(answer="return 1.0 / 0.0"))
    rig = low_rig(tmp_path, {"extensions": ["mine.py"], "fingertips": "mine"})
    code, told = ended(capsys, "run", "--rig", rig, "--grasps", 1, "--out", tmp_path / "runs", "--no-input")
    assert code == 1
    assert "this extension failed: ZeroDivisionError: float division by zero (line 9)" in told
    assert path.name in told
    (folder,) = (tmp_path / "runs").iterdir()
    session = Session.open(folder)
    assert session.manifest.status == "failed"
    assert len(list(session.traffic().messages())) > 0


def test_a_load_that_is_no_number_stops_the_hand_as_an_infinite_one(
    written: Written, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    written("mine.py", FINGERTIP.format(answer="return float('nan')"))
    rig = low_rig(tmp_path, {"extensions": ["mine.py"], "fingertips": "mine"})
    ended(capsys, "run", "--rig", rig, "--grasps", 1, "--out", tmp_path / "runs", "--no-input")
    (folder,) = (tmp_path / "runs").iterdir()
    assert "its load is not a number" in Session.open(folder).manifest.problem


def test_an_extension_that_cannot_be_loaded_ends_the_command_before_it_begins(written: Written, tmp_path: Path) -> None:
    path = written("mine.py", "raise RuntimeError('not today')\n")
    with pytest.raises(ConfigurationError, match=r"mine\.py: this extension could not be loaded.*not today"):
        CliRunner().invoke(
            app, ["--extension", str(path), "run", "--out", str(tmp_path / "runs")], catch_exceptions=False
        )
    assert not (tmp_path / "runs").exists()
