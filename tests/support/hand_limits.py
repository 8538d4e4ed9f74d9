"""What the simulated hand may do, and what is known of a flat box, for tests of policies."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from gtsam import Pose2

from drivers.shadow.closing.posture import HandShape
from sessions.motion.cycle_settings import CycleSettings
from sessions.motion.safety import SafetySettings
from tactile_lab.autonomy.hand_candidates import (
    HandLimits,
)
from tactile_lab.autonomy.heuristic_planner import PlanSettings
from tactile_lab.autonomy.policy_choice import Knowledge, PolicyChooser
from tactile_lab.autonomy.variance_planner import ExplorationSettings, KnownShape
from tactile_lab.slam.exploration.policies import make_policy
from tactile_lab.slam.tracking.contacts.motion import MotionNoise
from tests.support.box_shapes import FLAT_BOX


def limits(dimension: int = 2, **changes: object) -> HandLimits:
    made = HandLimits(PlanSettings(), ExplorationSettings(), CycleSettings(), SafetySettings(), HandShape(), dimension)
    return replace(made, **changes)  # type: ignore[arg-type]


def knowledge(known: KnownShape = FLAT_BOX, left: int | None = 5, x_m: float = 0.0) -> Knowledge:
    count = len(known.field.contacts_m)
    return Knowledge(known, Pose2(x_m, 0.0, 0.2), 1e-6 * np.eye(3), np.arange(count) // 5, left)


def chooser(policy: str = "variance", dimension: int = 2) -> PolicyChooser:
    return PolicyChooser(make_policy(policy), limits(dimension), MotionNoise(), np.random.default_rng(0))
