"""Where known objects may be pressed, and from which side."""

from __future__ import annotations

import numpy as np
import pytest

from calibration.steps.geometry import Block, KnownGeometry, Patch, TableEdges, patches
from calibration.steps.observations import Plane
from drivers.core.fingertip import RigidTransform

TABLE = TableEdges(size_m=(1.0, 0.6), centre_m=(0.1, -0.2), thickness_m=0.02, edge_sigma_m=3e-4, pressed_m=0.25)
BLOCK = Block(
    size_m=(0.06, 0.04, 0.02),
    world_T_block=RigidTransform(translation_m=(0.3, 0.1, 0.01), rpy_rad=(0.0, 0.0, np.pi / 2)),
    sigma_m=5e-5,
)


def by_name(geometry: KnownGeometry) -> dict[str, Patch]:
    return {patch.target.name: patch for patch in patches(geometry)}


def test_the_top_is_pressed_around_the_origin_and_an_edge_along_its_middle() -> None:
    found = by_name(KnownGeometry(table=TABLE, top_sigma_m=2e-4))
    assert list(found) == ["table top", "table edge +x", "table edge -x", "table edge +y", "table edge -y"]
    top = found["table top"]
    np.testing.assert_allclose(top.at(1.0, -1.0), [0.25, -0.25, 0.0])
    np.testing.assert_allclose(top.normal_world, [0.0, 0.0, 1.0])
    assert top.target.sigma_m == 2e-4
    edges = {
        "+x": ([0.6, -0.2, -0.01], [1, 0, 0], [0, 0.24, 0]),
        "-x": ([-0.4, -0.2, -0.01], [-1, 0, 0], [0, 0.24, 0]),
        "+y": ([0.1, 0.1, -0.01], [0, 1, 0], [0.4, 0, 0]),
        "-y": ([0.1, -0.5, -0.01], [0, -1, 0], [0.4, 0, 0]),
    }
    for name, (middle, normal, reach) in edges.items():
        edge = found[f"table edge {name}"]
        np.testing.assert_allclose(edge.centre_world_m, middle)
        np.testing.assert_allclose(edge.target.point_world_m, middle)
        np.testing.assert_allclose(edge.normal_world, normal)
        np.testing.assert_allclose(edge.reach_m, [reach, [0, 0, 0]], atol=1e-12)  # a finger stays on the thin edge
        assert edge.target.sigma_m == 3e-4


def test_without_edges_a_smaller_part_of_the_top_is_pressed() -> None:
    found = by_name(KnownGeometry(block=BLOCK))
    np.testing.assert_allclose(found["table top"].reach_m, [[0.15, 0, 0], [0, 0.15, 0]])
    assert not any("edge" in name for name in found)


def test_a_blocks_faces_turn_with_it_and_are_pressed_away_from_their_borders() -> None:
    found = by_name(KnownGeometry(block=BLOCK))
    assert [name for name in found if name.startswith("block")] == [
        *("block +x", "block -x", "block +y", "block -y", "block +z")
    ]
    front = found["block +x"]  # along the world's y, as the block is turned by a right angle
    np.testing.assert_allclose(front.normal_world, [0.0, 1.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(front.centre_world_m, [0.3, 0.13, 0.01], atol=1e-12)
    np.testing.assert_allclose(np.abs(front.reach_m), [[0.014, 0, 0], [0, 0, 0.007]], atol=1e-12)
    np.testing.assert_allclose(found["block -y"].normal_world, [1.0, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(found["block +z"].centre_world_m, [0.3, 0.1, 0.02], atol=1e-12)
    assert all(isinstance(patch.target, Plane) for patch in found.values())
    assert front.target.sigma_m == 5e-5


def test_a_point_is_pressed_from_above_at_itself() -> None:
    points = {"a": (0.1, 0.2, 0.3), "b": (0.2, 0.2, 0.3), "c": (0.1, 0.3, 0.3)}
    point = by_name(KnownGeometry(points_world_m=points))["point a"]
    np.testing.assert_allclose(point.at(1.0, 1.0), [0.1, 0.2, 0.3])
    np.testing.assert_allclose(point.normal_world, [0.0, 0.0, 1.0])
    with pytest.raises(ValueError, match="at least three points"):
        KnownGeometry(points_world_m={"a": points["a"], "b": points["b"]})
