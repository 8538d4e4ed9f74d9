"""What the hand feels before the first grasp of a guided session, if the operator wants it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from drivers.core.configuration import validate
from sessions.conductor.conductor import Conductor
from sessions.conductor.session_outcome import Ending, SessionOutcome
from sessions.guided.operator import Ask, Panel, Request, Stage
from sessions.guided.simulated_operator import Cue, SimulatedOperator
from tactile_lab.autonomy.guided_roles import guided_roles
from tactile_lab.autonomy.settings import SessionSettings
from tactile_lab.slam.slam_settings import SlamSettings
from tactile_lab.slam.tactile_slam import TactileSlam
from tests.support.disc_world import Disc, DiscWorld

QUICK = {"squeeze_s": 0.1, "finger_rad_s": 20.0, "travel_m_s": 1.0, "turn_rad_s": 5.0}
LOW = Disc(np.array([0.005, -0.004]))


def run(folder: Path, world: DiscWorld, operator: SimulatedOperator, led_by: str = "keys") -> SessionOutcome:
    content = {"grasps": 1, "fixed_grasps": 1, "cycle": QUICK, "guided": {"led_by": led_by, "attention_s": 600.0}}
    wanted = validate(content, SessionSettings, where="test")
    slam = TactileSlam(SlamSettings(method="odometry"), seed=1)
    roles = guided_roles(world, slam, wanted, operator, folder, seed=3)  # type: ignore[arg-type]
    return Conductor(world, wanted, roles).run()  # type: ignore[arg-type]


def at(stage: Stage) -> Callable[[Panel], bool]:
    return lambda panel: panel.stage is stage and bool(panel.asks)


def prompts(operator: SimulatedOperator) -> list[str]:
    return list(dict.fromkeys(panel.prompt.partition(".")[0] for panel in operator.panels if panel.prompt))


def test_the_hand_feels_how_tall_the_object_is_when_it_is_asked_to(tmp_path: Path) -> None:
    world, operator = DiscWorld(LOW), SimulatedOperator()
    assert run(tmp_path, world, operator).ending is Ending.COMPLETE
    assert any("mm high" in text for _, text in world.log_lines)
    first = ["Place the object on the table", "The hand feels where the object is, and how tall"]
    assert prompts(operator)[:3] == [*first, "Ready for the first grasp"]


def test_it_is_left_out_where_the_operator_does_without(tmp_path: Path) -> None:
    world, operator = DiscWorld(LOW), SimulatedOperator([Cue(at(Stage.FEEL), (Request(Ask.NEXT),))])
    assert run(tmp_path, world, operator).ending is Ending.COMPLETE
    assert not any("mm high" in text for _, text in world.log_lines)
    assert prompts(operator)[:2] == ["Place the object on the table", "Ready for the first grasp"]


@pytest.mark.parametrize("attended", [True, False])
def test_an_empty_table_is_told_and_ends_the_session_only_where_nobody_is_there(tmp_path: Path, attended: bool) -> None:
    again = lambda panel: "felt nothing on the table" in panel.message and bool(panel.asks)  # noqa: E731
    end = Cue(again, (Request(Ask.END, text="now"),))
    operator = SimulatedOperator([Cue(at(Stage.FEEL), (Request(Ask.GO),)), end], attended=attended)
    outcome = run(tmp_path, DiscWorld(None), operator)
    assert outcome.ending is (Ending.COMPLETE if attended else Ending.OBJECT_LOST)
    assert outcome.reason.startswith("ended by the operator" if attended else "no object")


def test_a_hand_that_a_person_leads_feels_nothing_by_itself(tmp_path: Path) -> None:
    operator = SimulatedOperator([Cue(at(Stage.PLACE), (Request(Ask.END, text="now"),))])
    run(tmp_path, DiscWorld(LOW), operator, led_by="hand")
    assert all(panel.stage is not Stage.FEEL for panel in operator.panels)


def test_what_is_tall_is_grasped_from_its_side_as_suggested_and_not_by_steps(tmp_path: Path) -> None:
    tall = DiscWorld(Disc(np.array([0.005, -0.004]), radius_m=0.035, height_m=0.15))
    step = Cue(at(Stage.GUIDE), (Request(Ask.MOVE, z=-1), Request(Ask.NEXT)))
    operator = SimulatedOperator([step, Cue(lambda panel: "not led by steps" in panel.message, (Request(Ask.GO),))])
    outcome = run(tmp_path, tall, operator)
    assert outcome.ending is Ending.COMPLETE
    assert len(outcome.grasps[0].touching) >= 3
    assert "The hand comes from the object's side" in prompts(operator)
