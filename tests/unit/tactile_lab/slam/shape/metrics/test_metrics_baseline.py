"""Numbers of errors, overlaps and alignments of fixed shapes."""

from __future__ import annotations

from dataclasses import astuple

import numpy as np
import trimesh
from gtsam import Pose2, Pose3, Rot3

from drivers.core.contacts import Array
from tactile_lab.slam.shape.metrics.alignment import align_contours, align_meshes
from tactile_lab.slam.shape.metrics.metrics import contour_errors, mesh_errors
from tactile_lab.slam.shape.metrics.overlap import mesh_overlap, polygon_overlap, shared_area
from tests.support.baseline import assert_baseline
from tests.support.shape_examples import ellipse, l_block, rectangle, triangle


def moved(outline_m: Array, angle: float, shift_m: tuple[float, float]) -> Array:
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return np.asarray(outline_m @ turn.T + shift_m)


def block(extents_m: tuple[float, float, float], turn: tuple[float, float, float], shift_m: Array) -> trimesh.Trimesh:
    mesh = trimesh.creation.box(extents_m)
    mesh.apply_transform(Pose3(Rot3.Expmap(np.array(turn)), shift_m).matrix())
    return mesh


def test_overlaps() -> None:
    """Areas that polygons share, apart, one in the other, clockwise, with sides in common; volumes of blocks."""
    pairs = {
        "turned": (l_block(), moved(l_block(), 0.5, (0.01, 0.0))),
        "apart": (triangle(), triangle() + 1.0),
        "inside": (0.5 * rectangle(), rectangle()),
        "clockwise": (l_block(), triangle()[::-1]),
        "beside": (rectangle(), np.add(rectangle(), [0.05, 0.06])),
        "round": (ellipse()[::30], triangle()),
    }
    values: dict[str, object] = {
        name: [1e4 * shared_area(*pair), polygon_overlap(*pair)] for name, pair in pairs.items()
    }
    one = block((0.1, 0.08, 0.06), (0.0, 0.0, 0.0), np.zeros(3))
    values["blocks"] = mesh_overlap(one, block((0.1, 0.06, 0.07), (0.1, 0.2, 0.4), np.full(3, 0.011)))
    values["far blocks"] = mesh_overlap(one, block((0.1, 0.06, 0.07), (0.1, 0.2, 0.4), np.full(3, 0.5)))
    assert_baseline("shape/metrics/overlaps", values)


def test_errors() -> None:
    """Of outlines a little or far apart, of one whose pose is known, and of blocks."""
    truth_T_estimated = Pose2(0.02, -0.01, 0.4)
    near = moved(l_block() * [1.02, 0.99], 0.01, (0.001, 0.0005))
    one, other = block((0.1, 0.08, 0.06), (0, 0, 0), np.zeros(3)), block((0.1, 0.081, 0.06), (0, 0, 0.01), np.zeros(3))
    values = {
        "near": astuple(contour_errors(near, l_block())),
        "posed": astuple(contour_errors(near, moved(l_block(), 0.4, (0.02, -0.01)), truth_T_estimated)),
        "far": astuple(contour_errors(triangle(), l_block() + 0.05)),
        "blocks": astuple(mesh_errors(other, one, Pose3(Rot3.Rz(0.01), np.array([0.0005, 0, 0])))),
    }
    assert_baseline("shape/metrics/errors", values)


def test_alignments() -> None:
    """Of outlines turned a little and by far, and of blocks, upright and free."""
    values = {}
    for angle in (0.1, 2.5):
        pose = align_contours(moved(l_block() * [1.0, 1.05], -angle, (0.03, 0.02)), l_block())
        values[f"outline {angle}"] = [pose.x(), pose.y(), pose.theta()]
    truth = block((0.1, 0.08, 0.06), (0, 0, 0), np.zeros(3))
    for name, turn, upright in (("upright", (0.0, 0.0, 0.3), True), ("free", (0.4, -0.3, 0.2), False)):
        estimate = block((0.1, 0.078, 0.061), turn, np.array([0.02, -0.01, 0.005]))
        found = align_meshes(estimate, truth, upright=upright)
        values[name] = [*Rot3.Logmap(found.rotation()), *found.translation()]
    assert_baseline("shape/metrics/alignments", values, rtol=1e-5, atol=1e-7)
