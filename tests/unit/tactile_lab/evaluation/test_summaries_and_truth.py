"""Tables for people, spreads, alignments and symmetries on small fixed inputs, compared with before."""

from __future__ import annotations

import math
from dataclasses import asdict
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from gtsam import Pose2, Pose3, Rot3
from scipy.stats import norm, t

from drivers.core.errors import TactileLabError
from sessions.perception.weighing.object_properties import ObjectProperties
from sessions.perception.weighing.weighing import Dragging, Hanging
from tactile_lab.evaluation.comparison import EvaluatedRun, compare, markdown, rows_csv, short_table, table
from tactile_lab.evaluation.consistency.levels import CURVE, LEVELS
from tactile_lab.evaluation.consistency.surfaces import surface_consistency
from tactile_lab.evaluation.files.plain import json_text, plain, read_json_object
from tactile_lab.evaluation.files.properties_file import PROPERTIES, read_measured, write_properties
from tactile_lab.evaluation.prism import open_ring, prism, signed_area_m2, triangulate
from tactile_lab.evaluation.registration import registration_rms_mm
from tactile_lab.evaluation.spread import Interval, Spread, number, quantile
from tactile_lab.evaluation.sweep import SweepRow, SweepRun, markdown_table, planned_runs, summaries
from tactile_lab.evaluation.table import evaluation_rows, further_text, one_draw
from tactile_lab.evaluation.truth.rotational_symmetry import (
    ball_centre_m,
    modulo_rotations,
    modulo_symmetry,
    outline_symmetry,
    stands,
    symmetry_turns,
)
from tactile_lab.evaluation.truth.time_alignment import Track, clock_offset
from tests.support.baseline import assert_baseline


def evaluation(seed: int, *, method: str = "joint", **changes: Any) -> dict[str, Any]:
    """An evaluation with made figures."""
    chance = np.random.default_rng(seed)
    found: dict[str, Any] = {
        "method": method,
        "dimension": 2,
        "object": "box",
        "seed": seed,
        "grasps": 6,
        "contacts": 28,
        "status": "complete",
        "failed": False,
        "shape": dict.fromkeys(("hausdorff_mm", "mean_distance_mm", "chamfer_mm"), float(chance.random())),
        "shape_best_fit": {"hausdorff_mm": 3 * float(chance.random()), "mean_distance_mm": float(chance.random())},
        "pose": {"rmse_mm": 2 * float(chance.random()), "rmse_deg": 4 * float(chance.random()), "final_mm": 1.0},
        "pose_umeyama": {"rmse_mm": 0.9, "largest_mm": 1.6, "rmse_deg": None if seed % 2 else 1.25},
        "consistency": {
            "levels": [0.5, 0.68, 0.95],
            "poses": {"inside": [0.4, 0.6, 0.9], "nees": 1.2, "log_score": 7.25},
            "surface": {"inside": [0.5, 0.7, 0.99], "signed_mm": -0.3, "log_score": 4.0},
        },
        "uncertainty": {"shared_sigma_mm": 0.8, "sigma_mm_median": 1.1},
        "registration_rms_mm": 5.5 if seed == 3 else 1.5,
        "symmetry_turns": None,
        "sensing": {"median_mm": 0.4, "p95_mm": 1.3},
        "loops": {"tested": 5, "accepted": 3, "wrong": 1},
        "time": {"total_s": 1.25, "step_ms_median": 120.4, "step_ms_p95": 300.6},
        "truth": {"seen": 5, "missing": 1},
        "known_share": 0.875,
        "dimensions": [{"name": "length", "mm": 101.26, "sigma_mm": 0.52, "true_mm": 100.0}],
        "further": {"roundness": 0.123456, "names": ["a"], "nothing": None},
    }
    return {**found, **changes}


def test_rows_for_people() -> None:
    """Of a whole evaluation, of one with almost nothing, and at every border of a word."""
    kinds = {
        "whole": evaluation(1),
        "empty": {},
        "singular": evaluation(2, grasps=1, truth={"seen": 1, "missing": 0}, loops={"tested": 0, "accepted": 0}),
        "symmetric": evaluation(3, symmetry_turns=6, dimensions=[{"name": "width", "mm": 9.0, "sigma_mm": 0.0}]),
    }
    told: dict[str, Any] = {
        kind: [list(asdict(row).values()) for row in evaluation_rows(each)] for kind, each in kinds.items()
    }
    shares = ((0.7071, 1.0), (0.7072, 1.0), (None, 1.0), (1.0, None))
    told["one draw"] = [one_draw({"shared_sigma_mm": shared, "sigma_mm_median": sigma}) for shared, sigma in shares]
    told["further"] = [further_text(value) for value in (None, 1, 123456.789, True, {"a": "ü"})]
    assert_baseline("evaluation/rows", told)


def runs() -> list[EvaluatedRun]:
    made = [EvaluatedRun(f"session {n}", "results", evaluation(n, failed=n == 3)) for n in range(4)]
    made += [EvaluatedRun(f"session {n}", "results-icp", evaluation(10 + n, method="icp")) for n in (0, 1, 3)]
    made += [
        EvaluatedRun("session 9", name, evaluation(20 + n, method="odometry", pose=None)) for n, name in enumerate("ab")
    ]
    return made


def test_comparisons_of_methods() -> None:
    found = compare(runs())
    told: dict[str, Any] = {"table": table(found), "short": short_table(found), "markdown": markdown(found)}
    told["csv"] = rows_csv(runs()).splitlines()
    told["figures"] = [[each.method, each.runs, each.failed, [asdict(f) for f in each.figures[:3]]] for each in found]
    assert_baseline("evaluation/comparison", told)


def test_sweeps_of_sessions() -> None:
    rows = [
        SweepRow(SweepRun("box", 2, 1), evaluation(1)),
        SweepRow(SweepRun("box", 2, 2), None, "it | broke"),
        SweepRow(SweepRun("box", 2, 3), evaluation(3, failed=True)),
        SweepRow(SweepRun("box", 3, 1), evaluation(4, status="lost")),
        SweepRow(SweepRun("disc", 2, 1), evaluation(5, ended_early="by a person")),
        SweepRow(SweepRun("disc", 2, 2), evaluation(6, shape_best_fit=None)),
        SweepRow(SweepRun("disc", 2, 3), None),
        SweepRow(SweepRun("disc", 2, 4), evaluation(7, pose=None)),
    ]
    told = {
        "planned": [list(asdict(run).values()) for run in planned_runs(["a", "b"], [2, 3], [1, 2])],
        "lines": [row.line() for row in rows],
        "failures": [row.as_json()["failure"] for row in rows],
        "table": markdown_table(summaries(rows)).splitlines(),
    }
    assert_baseline("evaluation/sweep", told)


def test_spreads_by_numpy_and_scipy() -> None:
    values = [3.0, 1.0, 4.0, 1.5, 9.0, 2.6, 5.0]
    for share in (0.0, 0.1, 0.25, 0.5, 0.9, 1.0):
        assert quantile(values, share) == pytest.approx(np.quantile(values, share))
    assert asdict(Spread.of(values)) == pytest.approx({"median": 3.0, "p90": np.quantile(values, 0.9), "largest": 9.0})
    mean, half = np.mean(values), t.ppf(0.975, 6) * np.std(values, ddof=1) / np.sqrt(7)
    found = Interval.of(values)
    assert [found.mean, found.low, found.high] == pytest.approx([mean, mean - half, mean + half])
    assert Interval.of([2.0]) == Interval(2.0, None, None)
    assert quantile([1.0, math.inf], 0.5) == math.inf
    assert quantile([1.0, 2.0, math.inf], 0.5) == 2.0
    assert Spread.of_known([None, None]) is None
    assert Spread.of([1.0, math.inf]).as_json() == {"median": None, "p90": None, "max": None}
    few = Interval.resampled(values[:4])
    assert (few.mean, few.low, few.high) == (pytest.approx(2.375), None, None)
    told = {
        "resampled": [asdict(Interval.resampled(values[:count])) for count in (5, 7)],
        "texts": [Interval.of(values).text(2), few.text(), Spread.of(values).text(3), number(math.inf, 1)],
        "zero": [
            [Interval(1.0, low, high).excludes_zero(margin) for margin in (0.0, 0.1)]
            for low, high in (
                (0.1, 2.0),
                (0.11, 2.0),
                (-2.0, -0.1),
                (-2.0, -0.11),
                (-1.0, 1.0),
                (0.0, 1.0),
                (None, 1.0),
            )
        ],
    }
    assert_baseline("evaluation/spread", told)


def test_share_of_a_surface_inside_its_intervals_by_scipy() -> None:
    """Errors at the quantiles of the stated distribution are inside as often as stated."""
    sigma_m = np.full(2001, 0.002)
    signed_m = 0.002 * norm.ppf((np.arange(2001) + 0.5) / 2001)
    found = surface_consistency(signed_m, sigma_m)
    np.testing.assert_allclose(found.inside, LEVELS, atol=6e-4)
    np.testing.assert_allclose(found.curve, CURVE, atol=6e-4)
    assert found.log_score == pytest.approx(norm.logpdf(signed_m, scale=0.002).mean())
    assert found.signed_mm == pytest.approx(0.0, abs=1e-9)
    assert surface_consistency(signed_m + 0.001, sigma_m).signed_mm == pytest.approx(1.0)


class Colour(Enum):
    RED = "red"


def test_values_as_plain_data(tmp_path: Path) -> None:
    values: dict[str, Any] = {
        "numbers": [1, 2.5, np.float64(3.5), np.int64(4), float("nan"), -math.inf, True, None],
        "arrays": [np.arange(3), np.array([[1.0, np.nan]])],
        "poses": [Pose2(1.0, 2.0, 0.0), Pose3()],
        "sets": [{3, 1, 2}, frozenset({"b", "a"}), ("x",)],
        "others": [Colour.RED, Path("a/b"), Interval(1.0, None, 2.0), SweepRun("a", 2, 1)],
        "keys": {1: "one", "two": Pose2()},
    }
    told: dict[str, Any] = {"plain": plain(values), "text": json_text(values).splitlines()[:6]}
    with pytest.raises(TypeError, match="cannot convert object"):
        plain(object())
    for name, content in {
        "list": "[1]",
        "torn": '{"a": ',
        "empty": "",
        "whole": '{"a": 1}',
        "twice": '{"a": 1} x',
    }.items():
        (tmp_path / name).write_text(content)
        try:
            told[name] = read_json_object(tmp_path / name, hint="Do this")
        except TactileLabError as error:
            told[name] = str(error).replace(str(tmp_path), "")
    assert_baseline("evaluation/plain", told)


def test_properties_in_the_object_frame(tmp_path: Path) -> None:
    known = ObjectProperties()
    write_properties(tmp_path, known, ())
    assert not (tmp_path / PROPERTIES).exists()
    hung = Hanging(3.0, 0.05, np.array([0.1, 0.2]), np.array([0.003, 0.004]), 0.0)
    known.hangings += [(0, hung), (1, Hanging(3.1, 0.05, np.array([0.2, 0.1]), np.array([0.001, 0.002]), 0.0))]
    known.draggings.append((0, Dragging(1.0, 0.1, 0.2)))
    told: dict[str, Any] = {}
    for name, poses in {
        "both": (Pose3(), Pose3(Rot3.Yaw(0.5), np.array([0.05, 0.0, 0.0]))),
        "first": (Pose3(Rot3.Yaw(1.0), np.zeros(3)), None),
        "none": (None, None),
    }.items():
        write_properties(tmp_path, known, poses)
        told[name] = read_json_object(tmp_path / PROPERTIES, hint="")
    mass = read_measured(tmp_path).mass_kg
    told["mass"] = mass and [mass.value, mass.sigma]
    (tmp_path / PROPERTIES).write_text('{"mass_kg": {"value": 1}}')
    with pytest.raises(TactileLabError, match="need finite values"):
        read_measured(tmp_path)
    assert_baseline("evaluation/properties", told)


def track(turn_rad_s: float = 0.8) -> Track:
    stamps = np.arange(0.0, 8.0, 0.04)
    places = np.column_stack([0.05 * np.sin(1.3 * stamps), 0.03 * np.cos(stamps), np.full(len(stamps), 0.2)])
    rotations = np.array([Rot3.Yaw(turn_rad_s * np.sin(s)).matrix() for s in stamps])
    return Track(stamps, places, rotations)


def test_clocks_of_camera_and_hand() -> None:
    """Held objects seen too late, too early, too briefly, at rest, or far too late; some pictures show nothing."""
    palm, told = track(), {}
    in_palm = np.array([0.04, 0.02, 0.0])
    chance = np.random.default_rng(2)
    cases: dict[str, tuple[float, tuple[tuple[float, float], ...], int]] = {
        "late": (0.037, ((0.5, 3.5), (4.0, 7.5)), 25),
        "early": (-0.021, ((0.0, 8.0),), 40),
        "short holds": (0.02, ((0.5, 1.05), (2.0, 2.55), (4.0, 4.6)), 160),
        "too few": (0.02, ((0.5, 1.2),), 20),
        "hardly enough": (0.02, ((0.5, 1.6),), 60),
        "far too late": (0.6, ((0.5, 3.5),), 40),
        "far too early": (-0.6, ((0.5, 3.5),), 40),
    }
    for name, (offset_s, holds, count) in cases.items():
        stamps = np.linspace(0.0, 8.0, count)
        at = np.clip(stamps + offset_s, palm.stamps_s[0], palm.stamps_s[-1])
        rows = np.round(at / 0.04).astype(int).clip(0, len(palm.stamps_s) - 1)
        places = np.einsum("nij,j->ni", palm.rotations[rows], in_palm) + palm.places_m[rows]
        seen = places[:, :2] + 1e-4 * chance.standard_normal((count, 2))
        seen[::9] = np.nan
        told[name] = asdict(clock_offset(palm, stamps, seen, holds))
    rest = Track(palm.stamps_s, np.zeros_like(palm.places_m), np.tile(np.eye(3), (len(palm.stamps_s), 1, 1)))
    told["at rest"] = asdict(clock_offset(rest, np.linspace(0, 8, 40), np.full((40, 2), 0.1), ((0.0, 8.0),)))
    assert_baseline("evaluation/clocks", told, rtol=1e-5, atol=1e-6)


def test_rotations_that_leave_an_object_unchanged() -> None:
    def ngon(sides: int, radius_m: float = 0.03) -> np.ndarray:
        angles = 2 * np.pi * np.arange(sides) / sides
        return radius_m * np.column_stack([np.cos(angles), np.sin(angles)])

    told: dict[str, Any] = {}
    for sides in (3, 4, 5, 6, 8, 64):
        vertices, faces = prism(ngon(sides), -0.02, 0.03)
        told[f"{sides} sides"] = [
            symmetry_turns(trimesh.Trimesh(vertices, faces, process=False)),
            (found := outline_symmetry(ngon(sides) + np.array([0.01, 0.02]))) and found.order,
            found and found.centre_m,
        ]
    dented = ngon(64)
    dented[:9] *= 0.93
    told["dented"] = [symmetry_turns(trimesh.Trimesh(*prism(dented, 0.0, 0.05), process=False))]
    truth = [Pose3(Rot3.Yaw(0.1 * n), np.array([0.01 * n, 0.0, 0.0])) for n in range(4)]
    ours = [Pose3(Rot3.Yaw(0.1 * n + 0.9 * n + 0.2), np.array([0.01 * n, 0.001 * n, 0.0])) for n in range(4)]
    for turns in (None, 6, 8, -1, 0):
        for centre in (np.zeros(2), np.array([0.01, -0.02])):
            try:
                told[f"turns {turns}, {centre[0]}"] = [
                    pose and pose.matrix()[:2]
                    for pose in modulo_symmetry([*ours, None], [*truth, truth[0]], turns, centre)
                ]
            except ZeroDivisionError:
                told[f"turns {turns}, {centre[0]}"] = "no order"
    lying = [Pose3(Rot3.Roll(angle), np.zeros(3)) for angle in (0.0, 0.0446, 0.0449, 1.5)]
    told["stands"] = [stands(pose) for pose in lying]
    told["lying"] = [pose and pose.matrix()[:2] for pose in modulo_symmetry(ours, [*truth[:3], lying[3]], 6)]
    assert_baseline("evaluation/symmetry", told, rtol=1e-5, atol=1e-6)


def test_a_ball_that_rolls_is_followed_by_its_centre() -> None:
    centre_m = np.array([0.01, 0.0, 0.03])
    ball = trimesh.creation.icosphere(3, 0.03).apply_translation(centre_m)
    found_m = ball_centre_m(ball)
    assert found_m is not None
    assert np.allclose(found_m, centre_m, atol=1e-4)
    assert ball_centre_m(trimesh.creation.cylinder(0.03, 0.06)) is None

    truth, estimate = [], []
    for n in range(4):
        rolled = Rot3.RzRyRx(0.2 * n, 0.1 * n, 0.0)
        place_m = np.array([0.1 + 0.02 * n, -0.01 * n, 0.03])
        truth.append(Pose3(rolled, place_m - rolled.rotate(centre_m)))
        estimate.append(Pose3(Rot3.Yaw(0.5 * n), place_m + np.array([0.0, 0.001 * (-1) ** n, 0.0])))
    points_m = [pose.transformFrom(centre_m) + 0.03 * np.eye(3) for pose in truth]
    told = modulo_rotations([*estimate, None], [*truth, truth[0]], centre_m)
    assert told[-1] is None
    assert registration_rms_mm(points_m, told[:-1], truth, 3) == pytest.approx(1.0, abs=0.05)
    assert modulo_rotations([None], truth[:1], centre_m) == (None,)


def test_solids_of_outlines() -> None:
    rings = {
        "square": [[0, 0], [1, 0], [1, 1], [0, 1]],
        "clockwise and closed": [[0, 0], [0, 1], [1, 1], [1, 0], [0, 0]],
        "L": [[0, 0], [0.10, 0], [0.10, 0.03], [0.03, 0.03], [0.03, 0.06], [0, 0.06]],
        "star": [
            [np.cos(a) * (1 + k % 2), np.sin(a) * (1 + k % 2)] for k, a in enumerate(np.linspace(0, 2 * np.pi, 11)[:-1])
        ],
        "crossed": [[0, 0], [1, 1], [1, 0], [0, 1], [-1, 0.5]],
        "two points": [[0, 0], [1, 0], [1, 0], [1, 5e-7]],
        "nearly the same": [[0, 0], [1, 0], [1, 2e-6], [1, 1]],
    }
    told: dict[str, Any] = {}
    for name, points in rings.items():
        try:
            ring = open_ring(np.array(points, dtype=float))
        except TactileLabError as error:
            told[name] = str(error)
            continue
        vertices, faces = prism(ring, -0.1, 0.2)
        told[name] = [ring, signed_area_m2(ring), triangulate(ring), vertices.sum(axis=0), faces]
    assert_baseline("evaluation/solids", told)
