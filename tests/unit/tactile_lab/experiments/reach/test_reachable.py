"""What a fingertip can get to: neither the underside, nor deep inside what is narrower than the hand."""

from __future__ import annotations

import numpy as np
import trimesh

from drivers.core.contacts import Array
from drivers.shadow.closing.posture import HandShape
from tactile_lab.experiments.data.household import turned
from tactile_lab.experiments.reach.reachable import ANY_YAW_rad, Mask, are_in_reach
from tactile_lab.slam.shape.surfaces.sampling import sample_mesh_with_normals

TOP_m = 0.10


def reached(mesh: trimesh.Trimesh, yaws_rad: tuple[float, float] = ANY_YAW_rad) -> tuple[Array, Array, Mask]:
    """Places of a surface whose foot is at zero, their normals, and which of them are in reach."""
    mesh.apply_translation([0.0, 0.0, -mesh.bounds[0][2]])
    points_m, normals = sample_mesh_with_normals(mesh, 120)
    return points_m, normals, are_in_reach(mesh, points_m, normals, [yaws_rad], HandShape())


def test_top_and_sides_of_a_box_are_in_reach_but_not_its_foot_nor_its_underside() -> None:
    points_m, normals, found = reached(trimesh.creation.box((0.06, 0.08, TOP_m)))
    beside = np.abs(normals[:, 2]) < 0.1
    assert found[normals[:, 2] > 0.9].mean() > 0.95
    assert found[beside & (points_m[:, 2] > 0.03)].mean() > 0.95
    assert not found[points_m[:, 2] < 0.006].any()


def test_the_inside_of_a_wide_pipe_is_in_reach_near_its_rim_and_that_of_a_narrow_one_is_not() -> None:
    for inner_m, near_rim in ((0.045, True), (0.006, False)):
        points_m, normals, found = reached(trimesh.creation.annulus(inner_m, inner_m + 0.006, TOP_m))
        inside = np.einsum("nk,nk->n", points_m[:, :2], normals[:, :2]) < -1e-4
        assert inside.sum() > 10
        assert found[inside & (points_m[:, 2] > TOP_m - 0.03)].any() == near_rim
        assert not found[inside & (points_m[:, 2] < 0.006)].any()


def test_the_floor_of_a_dish_is_in_reach_and_that_of_a_deep_pot_is_not() -> None:
    for top_m, is_reached in ((0.05, True), (0.12, False)):
        pot = turned([0, 50, 50, 46, 46, 0], [0, 0, 1e3 * top_m, 1e3 * top_m, 5, 5])
        points_m, normals, found = reached(pot)
        floor = (normals[:, 2] > 0.9) & (points_m[:, 2] < 0.01) & (np.hypot(*points_m[:, :2].T) < 0.03)
        assert floor.sum() > 3
        assert found[floor].any() == is_reached


def test_a_hand_that_hardly_turns_reaches_less() -> None:
    box = trimesh.creation.box((0.16, 0.16, TOP_m))
    assert reached(box.copy(), (-0.1, 0.1))[2].sum() < reached(box)[2].sum()
