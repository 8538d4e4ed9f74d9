"""Numbers of the likelihood of poses, compared with those stored: any change of them is told."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Literal

import numpy as np
import pytest

from tactile_lab.slam.tracking.contacts.contact_map import ContactMap
from tactile_lab.slam.tracking.contacts.motion import MotionNoise
from tactile_lab.slam.tracking.evidence.fixed_lag import condense, unfold
from tactile_lab.slam.tracking.evidence.motion_cost import MotionCost, estimated_noise, pushed_nats
from tactile_lab.slam.tracking.evidence.pose_evidence import PoseEvidence
from tests.support.baseline import assert_baseline
from tests.support.baseline_problems import KINDS, Kind, session, true_placed, varied_map
from tests.support.digest import digest

NOISE = MotionNoise(translation_m=0.004, rotation_rad=0.1, unheld=0.15)
LOOSE = MotionNoise(translation_m=0.003, rotation_rad=0.07, unheld=0.8, gripped=False)


def shaken(known: ContactMap, by: float) -> np.ndarray:
    """Its poses, each moved by so many centimetres and tenths of a radian, the first left."""
    step = np.where(np.arange(known.space.size) < known.space.translations, 0.01, 0.1)
    away = np.sin(1.9 * np.arange(known.rows.size)).reshape(known.rows.shape)
    away[0] = 0.0
    return known.space.move(known.rows, by * step * away)


@pytest.mark.parametrize("noise", [NOISE, LOOSE], ids=["gripped", "loose"])
@pytest.mark.parametrize("kind", KINDS)
def test_the_cost_of_motion(kind: Kind, noise: MotionNoise) -> None:
    """Of steps as meant, felt, left in place, pushed and free: near the motion and far from it, with derivatives."""
    known = varied_map(kind)
    motion = MotionCost.of(known, noise)
    values: dict[str, Any] = {"push": pushed_nats(noise, known.space)}
    for name, rows in (("near", known.rows), ("far", shaken(known, 2.0))):
        value, gradient = motion.value_and_gradient(rows)
        values[name] = {
            "steps": motion.steps(rows),
            "value": [value, motion.value(rows)],
            "gradient": gradient,
            "information": digest(motion.information(rows)),
            "slips": motion.slips_in_sigma(rows),
            "scaled": motion.scaled_slips(rows),
        }
    unlabelled = MotionCost(known.motions, noise, known.space)
    values["all as meant"] = unlabelled.steps(known.rows)
    learnt = estimated_noise(known.with_rows(shaken(known, 1.0)), noise)
    values["learnt"] = [learnt.translation_m, learnt.rotation_rad, learnt.unheld]
    name = "gripped" if noise.gripped else "loose"
    assert_baseline(f"tracking/evidence/motion-{kind}-{name}", values)


@pytest.mark.parametrize("kernel", ["matern52", "squared_exponential", "thin_plate"])
@pytest.mark.parametrize("kind", KINDS)
def test_the_likelihood_of_poses(kind: Kind, kernel: Literal["matern52", "squared_exponential", "thin_plate"]) -> None:
    """With each kernel: at the truth and away from it, with derivatives, and some steps towards the best poses."""
    known = varied_map(kind)
    known = replace(known, settings=known.settings.model_copy(update={"kernel": kernel, "length_m": 0.06}))
    evidence, rows = PoseEvidence(known, NOISE), shaken(known, 0.3)
    value, gradient = evidence.value_and_gradient(rows)
    places = known.contacts.points_m[::4] + 0.003
    found, least = evidence.maximise(rows, 4)
    values = {
        "value": [value, evidence.value(known.rows)],
        "gradient": gradient,
        "information": digest(evidence.information(rows)),
        "field change": digest(evidence.field_change(rows, places)),
        "best": found,
        "least": least,
        "sooner": evidence.maximise(rows, 30, accuracy=30.0)[1],
        "alone": PoseEvidence(replace(known, placed=known.placed[:1]), NOISE).maximise(rows[:1], 4)[1],
    }
    assert_baseline(f"tracking/evidence/likelihood-{kind}-{kernel}", values, rtol=1e-5, atol=1e-7)


def test_contacts_on_top_of_each_other_have_a_likelihood_too() -> None:
    """A step of the optimiser that throws all contacts onto one point: its covariance has no factor."""
    known = true_placed(session("plane", count=3), "plane")
    grasps = []
    for grasp in known.placed:
        seen = grasp.contacts_world
        points = np.zeros_like(seen.points_m)
        sure = replace(seen, points_m=points, point_sigma_m=np.full(len(points), 1e-9))
        grasps.append(replace(grasp, contacts_world=sure, pose=np.zeros(3)))
    known = replace(known, placed=tuple(grasps))
    assert np.isfinite(PoseEvidence(known, NOISE).value(known.rows))


@pytest.mark.parametrize("kind", KINDS)
def test_a_summary_of_settled_grasps(kind: Kind) -> None:
    """Early grasps of a session summarized by a few contacts and free places, and again when two more have come."""
    whole = true_placed(session(kind, count=6), kind)
    short = condense(replace(whole, placed=whole.placed[:5]), 2, 7)
    shorter = condense(replace(short, placed=(*short.placed, whole.placed[5])), 2, 6)
    values = {
        name: {
            "points": one.contacts.points_m,
            "free": one.free_points_m,
            "rows": one.rows,
            "motion": one.motions[0],
            "archived": [sorted(each.left_out) for each in one.archive],
            "open again": unfold(one).rows,
        }
        for name, one in (("once", short), ("twice", shorter))
    }
    assert_baseline(f"tracking/evidence/summary-{kind}", values)
