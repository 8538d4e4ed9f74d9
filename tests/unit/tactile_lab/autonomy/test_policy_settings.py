"""A rig's file sets what the policy ``information`` reckons with: every setting changes decisions, none is made up."""

from __future__ import annotations

import json
import shutil
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from gtsam import Pose2
from typer.testing import CliRunner

from drivers.core.errors import ConfigurationError
from drivers.shadow.closing.posture import HandShape
from tactile_lab.autonomy.autonomous_roles import chooser_for
from tactile_lab.autonomy.policy_choice import Knowledge
from tactile_lab.cli.app import app
from tactile_lab.rigs.description import Rig, RigDescription, describe, load_rig, shipped_rigs
from tactile_lab.rigs.effective_settings import effective_settings, flat
from tactile_lab.slam.exploration.expected_information import InformationSettings
from tactile_lab.slam.exploration.policies import POLICIES, make_policy
from tactile_lab.slam.exploration.policy import Decision
from tactile_lab.slam.tracking.contacts.motion import MotionNoise
from tests.support.box_shapes import FLAT_BOX, solid_box

FEW = {"yaws": 2, "shifts_m": [0.0], "side_closings": []}
"""Two candidates of the hand, and a tap in space."""
TALL_BOX = solid_box(0.055)
"""Of its grasps some have transports above the fingertips on it."""
COVARIANCE = np.diag([0.01, 0.01, 0.2]) ** 2

Content = dict[str, Any]
CHANGES: tuple[tuple[int, str, float, Content], ...] = (
    (2, "worlds", 7, {}),
    (3, "worlds_in_space", 5, {}),
    (2, "execution.palm_m", 0.02, {}),
    (2, "execution.palm_rad", 0.4, {}),
    (2, "execution.finger_m", 0.015, {}),
    (2, "reach_m", 0.009, {}),
    (3, "reach_in_space_m", 0.02, {}),
    (2, "detail_m", 0.01, {}),
    (2, "point_sigma_m", 0.01, {}),
    (2, "accuracy_m", 0.01, {}),
    (3, "accuracy_in_space_m", 0.0, {}),
    (2, "normal_sigma_rad", 0.5, {}),
    (2, "pose_sigma_m", 0.03, {}),
    (2, "pose_weight", 0.0, {}),
    (2, "least_gain", 1e6, {}),
    (2, "known_sigma_m", 1.0, {"enough": 0.3}),
    (2, "enough", 0.3, {"known_sigma_m": 1.0}),
    (2, "push_worth", 0.5, {}),
    (3, "push_worth_in_space", 0.5, {}),
)
"""Dimension, setting, another value, and what else has to be set for it to matter."""


def description(information: Content) -> RigDescription:
    content = yaml.safe_load(shipped_rigs()["sim"].read_text())
    content["conductor"] = {
        "exploration": {"policy": "information", **FEW, "information": information},
        "plan": {"closings": ["radial"], "surface_heights_m": [0.018], "contour_top_m": 0.07},
    }
    return describe(content, where="rig")


def decision(dimension: int, information: Content) -> Decision:
    """What a session on that rig decides about a box that is known in part."""
    own = description(information).conductor
    assert own.exploration.policy is not None
    limits = own.plan, own.exploration, own.cycle, own.safety
    chooser = chooser_for(own.exploration.policy, limits, HandShape(), dimension, MotionNoise(), 0)
    known = FLAT_BOX if dimension == 2 else TALL_BOX
    grasps = np.arange(len(known.field.contacts_m)) // 5
    return chooser.choose(3, Knowledge(known, Pose2(0.0, 0.0, 0.2), COVARIANCE, grasps)).decision


@lru_cache
def usual(dimension: int, base: str) -> Decision:
    return decision(dimension, json.loads(base))


def nested(name: str, value: float) -> Content:
    head, _, rest = name.partition(".")
    return {head: nested(rest, value) if rest else value}


@pytest.mark.parametrize(("dimension", "name", "value", "base"), CHANGES, ids=[change[1] for change in CHANGES])
def test_every_setting_in_a_rig_file_changes_what_is_decided(
    dimension: int, name: str, value: float, base: Content
) -> None:
    before, after = usual(dimension, json.dumps(base)), decision(dimension, base | nested(name, value))
    assert before.outcome == "grasp"
    assert (after.outcome, after.scores) != (before.outcome, before.scores)


def test_no_setting_is_left_out_above() -> None:
    assert sorted(change[1] for change in CHANGES) == sorted(flat(InformationSettings().model_dump()))


def test_a_grasp_is_refused_where_the_rig_asks_for_more_than_it_promises() -> None:
    stopped = decision(2, {"least_gain": 1e6})
    assert (stopped.outcome, stopped.chosen) == ("stop", None)
    assert "less than the 1e+06 asked" in stopped.reason


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"information": {"pose_weigth": 0}}, r"information.pose_weigth: unknown key \(did you mean pose_weight\?\)"),
        ({"information": {"execution": {"palm": 0.1}}}, r"execution.palm: unknown key \(did you mean palm_m\?\)"),
        ({"information": {"pose_weight": -1}}, "pose_weight: must be greater than or equal to 0, not -1"),
        ({"policy": "best"}, "there is no policy 'best'. Policies are random, .*information"),
        ({"side_heights_m": [0.026, 0.5]}, r"side_heights_m.1: must be less than or equal to 0.12, not 0.5"),
    ],
)
def test_a_setting_that_does_not_exist_is_named(changes: Content, words: str) -> None:
    content = {**yaml.safe_load(shipped_rigs()["sim"].read_text()), "conductor": {"exploration": changes}}
    with pytest.raises(ConfigurationError, match=words):
        describe(content, where="rig")


@pytest.mark.parametrize("name", [name for name in POLICIES if name != "information"])
def test_the_policies_of_the_thesis_stay_as_printed(name: str) -> None:
    changed = make_policy(name, InformationSettings(pose_weight=0.0))
    assert type(changed) is type(make_policy(name))
    assert not isinstance(getattr(changed, "settings", None), InformationSettings)


# --- what shows a rig ----------------------------------------------------------------------------------------------


@pytest.fixture
def lab(tmp_path: Path) -> Path:
    shutil.copytree(shipped_rigs()["sim"].parent / "calibrations", tmp_path / "calibrations")
    content = yaml.safe_load(shipped_rigs()["sim"].read_text())
    content["conductor"] = {"exploration": {"information": {"pose_weight": 0.25}}}
    path = tmp_path / "lab.yaml"
    path.write_text(yaml.safe_dump(content))
    return path


def test_a_rig_shows_the_settings_that_are_not_the_usual_ones(lab: Path) -> None:
    answer = CliRunner().invoke(app, ["rig", "show", str(lab)])
    assert answer.exit_code == 0
    (line,) = [line for line in answer.stdout.splitlines() if "pose_weight" in line]
    assert line.split() == ["conductor.exploration.information.pose_weight", "0.25", "1.0"]
    assert "least_gain" not in answer.stdout
    everything = CliRunner().invoke(app, ["rig", "show", str(lab), "--all"]).stdout
    assert "conductor.exploration.information.least_gain" in everything


def test_a_rig_is_shown_to_programs_as_sessions_keep_it(lab: Path) -> None:
    told = json.loads(CliRunner().invoke(app, ["rig", "show", str(lab), "--json"]).stdout)
    assert told.pop("file") == str(lab)
    loaded: Rig = load_rig(str(lab))
    assert told == loaded.plain()
    assert told["conductor"]["exploration"]["information"]["pose_weight"] == 0.25


def test_a_rig_file_that_says_no_more_than_it_must_has_usual_settings_alone() -> None:
    content = yaml.safe_load(shipped_rigs()["sim"].read_text())
    bare = describe({**content, "conductor": {}, "motion": {}, "hand": {}}, where="rig")
    assert [item for item in effective_settings(bare) if item.value != item.usual] == []
