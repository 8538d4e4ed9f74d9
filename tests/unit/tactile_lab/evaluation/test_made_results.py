"""All files and figures of results made by hand, compared with before; some of them with plain formulas."""

from __future__ import annotations

import json
from dataclasses import asdict, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gtsam import Pose3, Rot3

from tactile_lab.evaluation.consistency.pose_covariance import covariance_in_world
from tactile_lab.evaluation.consistency.poses import birth_frame, common_frame, pose_consistency
from tactile_lab.evaluation.consistency.surfaces import outline_consistency, surface_consistency
from tactile_lab.evaluation.evaluation import evaluate
from tactile_lab.evaluation.felt_slips import FeltSlips
from tactile_lab.evaluation.files.results import read_results
from tactile_lab.evaluation.loops import first_in_map, wrong_loops
from tactile_lab.evaluation.registration import registration_rms_mm, registration_verdict
from tactile_lab.evaluation.result_warnings import result_warnings
from tactile_lab.evaluation.slips import Slips
from tactile_lab.evaluation.standard_error import standard_errors
from tactile_lab.evaluation.table import evaluation_rows
from tactile_lab.evaluation.trajectory import pose_errors
from tests.support.baseline import assert_baseline
from tests.support.made_results import (
    COUNT,
    contour,
    grasps,
    loops,
    poses,
    true_poses,
    truth,
    written,
    yaw_pose,
)
from tests.support.said import as_name, said

KINDS = ("2, box", "3, box", "2, outline", "2, lost")
CLOSE = {"rtol": 1e-5, "atol": 1e-7}


def made(kind: str, folder: Path) -> dict[str, Any]:
    dimension, what = int(kind[0]), kind[3:]
    written(folder, dimension, "lost" if what == "lost" else "partial")
    known = truth(shaped=what != "lost", outline=what == "outline")
    return evaluate(folder, known, "a box").as_json()


@pytest.mark.parametrize("kind", KINDS)
def test_the_whole_evaluation(kind: str, tmp_path: Path) -> None:
    evaluation = made(kind, tmp_path)
    assert json.loads(json.dumps(evaluation), parse_float=lambda text: round(float(text), 6)) == evaluation
    rows = [list(asdict(row).values()) for row in evaluation_rows(evaluation)]
    assert_baseline(f"evaluation/{as_name(kind)}", {**evaluation, "rows": rows}, rtol=1e-4, atol=2e-6)


def test_errors_of_trajectories_by_plain_formulas() -> None:
    """Distances, angles and a slope, by a script that knows nothing of the program's."""
    found = pose_errors(poses(), true_poses())
    assert found is not None
    both = [(n, p.matrix(), t.matrix()) for n, (p, t) in enumerate(zip(poses(), true_poses(), strict=True)) if p and t]
    fixed = np.linalg.inv(both[0][1]) @ both[0][2]
    errors, aligned = [], [(t, p @ fixed) for _, p, t in both]
    for true, ours in aligned:
        errors.append(_difference(np.linalg.inv(true) @ ours))
    table = np.array(errors)
    steps = np.array(
        [
            _difference(np.linalg.inv(np.linalg.inv(a[0]) @ b[0]) @ (np.linalg.inv(a[1]) @ b[1]))
            for a, b in pairwise(aligned)
        ]
    )
    number = np.array([n for n, _, _ in both], dtype=float)
    slope = number @ table / (number @ number)
    rms, step = np.sqrt((table[1:] ** 2).mean(axis=0)), np.sqrt((steps**2).mean(axis=0))
    ours = [found.rmse_mm, found.rmse_deg, found.final_mm, found.final_deg, found.step_mm, found.step_deg]
    np.testing.assert_allclose(ours, [*rms, *table[-1], *step], rtol=1e-6)
    np.testing.assert_allclose([found.drift_mm_per_grasp, found.drift_deg_per_grasp], slope, rtol=1e-6)
    assert [each is None for each in found.per_grasp] == [n in (2, 5) for n in range(COUNT)]


def _difference(motion: np.ndarray) -> list[float]:
    angle = np.arccos(np.clip((np.trace(motion[:3, :3]) - 1) / 2, -1.0, 1.0))
    return [1e3 * float(np.linalg.norm(motion[:3, 3])), float(np.degrees(angle))]


def test_trajectories_of_which_little_is_known() -> None:
    """Too short, on a line, without the first grasp, and one that is only turned."""
    ours, theirs = poses(), true_poses()
    line = tuple(yaw_pose(0.01 * n, 0.0, 0.2 * n) for n in range(COUNT))
    bent = tuple(yaw_pose(0.01 * n, 0.0001 * n * n, 0.2 * n + 0.01 * n) for n in range(COUNT))
    kinds: dict[str, tuple[tuple[Pose3 | None, ...], tuple[Pose3 | None, ...]]] = {
        "all": (ours, theirs),
        "two": (ours[:2], theirs[:2]),
        "one": (ours[:1], theirs[:1]),
        "four": (ours[:4], theirs[:4]),
        "without the first": ((None, *ours[1:]), theirs),
        "truth without the first": (ours, (None, *theirs[1:])),
        "on a line": (line, bent),
        "nearly on a line": (tuple(yaw_pose(0.01 * n, 0.0012 * (n % 2), 0.0) for n in range(COUNT)), line),
        "in space": (
            tuple(Pose3(Rot3.Ypr(0.3 * n, 0.2, 0.1 * n), np.array([0.01 * n, n % 2, n % 3])) for n in range(COUNT)),
            line,
        ),
    }
    told: dict[str, Any] = {}
    covariances = [None if n == 4 else np.diag([4e-6, 4e-6, 0.0, 1e-12, 0.0, 4e-4]) * (n > 0) for n in range(COUNT)]
    for kind, (estimate, known) in kinds.items():
        errors, standard = pose_errors(estimate, known), standard_errors(estimate, known)
        frames = birth_frame(estimate, known), common_frame(estimate, known)
        judged = [pose_consistency(estimate, covariances[: len(estimate)], known, frame) for frame in frames]
        told[kind] = {
            "errors": errors and asdict(errors),
            "standard": standard and asdict(standard),
            "frames": [frame and frame.matrix()[:3] for frame in frames],
            "consistency": [each and asdict(each) for each in judged],
            "loops": wrong_loops([vars_of(loop) for loop in loops()], estimate, known) if len(estimate) > 4 else None,
            "first": first_in_map(estimate),
            "registration": [
                registration_rms_mm([grasp.points_world_m for grasp in grasps()[: len(estimate)]], estimate, known, d)
                for d in (2, 3)
            ],
        }
    assert_baseline("evaluation/trajectories", told, rtol=1e-5, atol=1e-6)


def vars_of(loop: Any) -> dict[str, Any]:
    entry = {name: getattr(loop, name) for name in ("earlier", "later", "accepted")}
    return {**entry, "earlier_T_later": loop.earlier_T_later.matrix(), "displacement": loop.displacement.matrix()}


@pytest.mark.parametrize(
    ("off_mm", "off_deg", "wrong"), [(9.9, 0.0, 0), (10.1, 0.0, 1), (0.0, 9.9, 0), (0.0, -10.1, 1)]
)
def test_a_loop_is_wrong_from_a_centimetre_or_ten_degrees_on(off_mm: float, off_deg: float, wrong: int) -> None:
    known = (yaw_pose(0.0, 0.0, 0.0), yaw_pose(0.1, 0.0, 0.5))
    loop = {
        "earlier": 0,
        "later": 1,
        "accepted": True,
        "earlier_T_later": (known[1] * yaw_pose(0.0, 1e-3 * off_mm, np.radians(off_deg))).matrix()[
            np.ix_([0, 1, 3], [0, 1, 3])
        ],
    }
    assert wrong_loops([loop], known, known) == wrong
    assert wrong_loops([loop | {"accepted": False}], known, known) == 0


def test_uncertainty_of_surfaces() -> None:
    signed_m = 0.001 * np.linspace(-3.0, 4.0, 200)
    told = {
        "flat": asdict(surface_consistency(signed_m, np.full(200, 0.002))),
        "certain": asdict(surface_consistency(signed_m, np.zeros(200))),
    }
    square = 0.03 * np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
    from gtsam import Pose2

    for name, pose in {"moved": Pose2(0.002, -0.001, 0.1), "turned": Pose2(0.0, 0.0, 0.7)}.items():
        told[name] = asdict(outline_consistency(contour().points_m, contour().sigma_m, square, pose))
    turned = Pose3(Rot3.Ypr(0.4, 0.3, -0.2), np.zeros(3))
    told["pose"] = {"covariance": covariance_in_world(turned, np.diag([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])).tolist()}
    assert_baseline("evaluation/surfaces", told, **CLOSE)


def test_slips_between_grasps() -> None:
    """Of the made session, and of ones with just enough steps, carried and left."""
    chance = np.random.default_rng(8)
    told: dict[str, Any] = {}
    own = Slips.between(grasps(), true_poses())
    felt = FeltSlips.between(grasps(), true_poses())
    told["own"] = [own.carried, own.left, felt.missed, felt.sigmas, felt.scale, own.motion]
    for count in (9, 10, 30):
        slips = Slips(
            0.002 * chance.standard_normal((count, 3)), 0.0004 * chance.standard_normal((count, 3)) + [0.0, 0, 1e-5]
        )
        joined = Slips.join([slips, own])
        motion = slips.motion
        told[f"{count} steps"] = [
            motion and motion.model_dump(),
            motion and slips.pushed_count(motion),
            joined.carried.shape,
            joined.left.sum(axis=0),
        ]
        many = FeltSlips(0.002 * chance.standard_normal((count, 3)), np.tile([0.001, 0.002], (count, 1)))
        told[f"{count} felt"] = [
            many.scale,
            many.in_words(),
            many.share_within(1.0),
            FeltSlips.join([many, felt]).missed.shape,
        ]
    hard = Slips(0.01 * chance.standard_normal((20, 3)), 0.05 * chance.standard_normal((20, 3)))
    told["pushed"] = [hard.motion and hard.motion.model_dump(), hard.motion and hard.pushed_count(hard.motion)]
    assert_baseline("evaluation/slips", told)


def test_warnings_at_their_limits(tmp_path: Path) -> None:
    told = {}
    base = read_results(written(tmp_path, 2))
    opposite = tuple(
        replace(rows, normals_world=np.tile([1.0, 0.0, 0.0], (len(rows.fingers), 1))) for rows in base.contacts
    )
    changes: dict[str, dict[str, Any]] = {
        "as it is": {},
        "a ninth": {"known_share": 0.89},
        "a tenth": {"known_share": 0.9},
        "old": {"known_share": None},
        "old, certain": {"known_share": None, "sigma_quantiles_m": [0.001] * 101},
        "old, a tenth": {"known_share": None, "sigma_quantiles_m": [0.001] * 9 + [0.5]},
        "old, at the limit": {"known_share": None, "sigma_quantiles_m": [0.001] * 4 + [0.5]},
        "no shape": {"sigma_quantiles_m": None},
        "lost": {"status": "lost"},
        "ok": {"status": "ok", "doubts": [], "warnings": []},
    }
    for name, change in changes.items():
        found = replace(base, slam={**base.slam, **change})
        told[name] = [found.status, found.known_share, result_warnings(found)]
    told["one side"] = result_warnings(replace(base, contacts=opposite))
    told["verdicts"] = [registration_verdict(error, turns) for error in (4.9, 5.0, 5.1) for turns in (None, 6)]
    assert_baseline("evaluation/warnings", told)


def test_results_that_do_not_belong_to_the_session(tmp_path: Path) -> None:
    written(tmp_path, 2)
    known = truth()
    words = said(
        lambda: evaluate(tmp_path, replace(known, world_T_object=known.world_T_object[:-1]), "a box"), tmp_path
    )
    assert words == ": 7 grasps in the results, 6 in the session. Replay the session to update its results"
