"""Simulated contacts in the plane: where they lie, what is free space, and that they repeat."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.core.errors import ConfigurationError
from drivers.core.poses import rotate, transform_points
from tactile_lab.experiments.data.outlines import OUTLINES_m, edge_normals, first_crossing
from tactile_lab.experiments.data.planar_data import PlanarGrasps, random_contacts, simulate
from tactile_lab.slam.shape.metrics.overlap import polygon_overlap
from tactile_lab.slam.shape.surfaces.sampling import distances_to_polygon, polygon_area


def on_body(data: PlanarGrasps) -> np.ndarray:
    """All contacts in body coordinates."""
    pairs = zip(data.grasps, data.world_T_body, strict=True)
    return np.concatenate([transform_points(pose.inverse(), grasp.points_world_m) for grasp, pose in pairs])


def inside(points: np.ndarray, outline: np.ndarray) -> np.ndarray:
    """Even-odd rule."""
    ends = np.roll(outline, -1, axis=0)
    x, y = points[:, :1], points[:, 1:]
    spans = (outline[:, 1] > y) != (ends[:, 1] > y)
    with np.errstate(divide="ignore", invalid="ignore"):
        at = outline[:, 0] + (y - outline[:, 1]) * (ends[:, 0] - outline[:, 0]) / (ends[:, 1] - outline[:, 1])
    return (spans & (x < at)).sum(axis=1) % 2 == 1


@pytest.mark.parametrize("shape", OUTLINES_m)
def test_outlines_turn_left_and_have_a_graspable_size(shape: str) -> None:
    outline = OUTLINES_m[shape]
    assert 0.003 < polygon_area(outline) < 0.007
    assert np.linalg.norm(np.roll(outline, -1, axis=0) - outline, axis=1).min() > 1e-4
    assert polygon_overlap(outline, outline) == pytest.approx(1.0)


@pytest.mark.parametrize("shape", OUTLINES_m)
def test_contacts_lie_on_the_outline_within_the_sensors_noise(shape: str) -> None:
    data = simulate(shape, 0)
    points = on_body(data)
    assert len(data.grasps) == 16
    assert len(points) > 70
    rms = np.sqrt(np.mean(distances_to_polygon(points[:, :2], data.outline_m) ** 2))
    assert 0.0006 < rms < 0.0013
    assert np.all(points[:, 2] == 0)


def test_normals_point_out_within_five_degrees() -> None:
    data = simulate("rectangle", 3, count=60)
    normals = np.concatenate(
        [
            rotate(pose.inverse(), grasp.normals_world)
            for grasp, pose in zip(data.grasps, data.world_T_body, strict=True)
        ]
    )
    cosines = (normals[:, :2] @ edge_normals(data.outline_m).T).max(axis=1)
    assert np.rad2deg(np.sqrt(np.mean(np.arccos(np.clip(cosines, -1, 1)) ** 2))) == pytest.approx(5.0, abs=0.6)


@pytest.mark.parametrize("shape", ["rectangle", "L", "stadium"])
def test_closing_lines_are_outside_until_the_contact(shape: str) -> None:
    data = simulate(shape, 1)
    missed = 0
    for grasp, pose in zip(data.grasps, data.world_T_body, strict=True):
        assert [line.finger for line in grasp.approach_paths] == ["FF", "MF", "RF", "LF", "TH"]
        assert [c.finger for c in grasp.contacts] == [line.finger for line in grasp.approach_paths if line.touched]
        for line in grasp.approach_paths:
            way = line.start_world_m - line.end_world_m
            length = np.linalg.norm(way)
            before = line.end_world_m + np.outer(np.linspace(0.008 if line.touched else 0.0, length, 60), way / length)
            assert not inside(transform_points(pose.inverse(), before)[:, :2], data.outline_m).any()
            missed += not line.touched
    assert missed > 0 or shape != "stadium"


def test_a_seed_gives_the_same_data_and_another_one_others() -> None:
    first, second, other = simulate("L", 5), simulate("L", 5), simulate("L", 6)
    assert np.array_equal(on_body(first), on_body(second))
    assert on_body(first).shape != on_body(other).shape or not np.allclose(on_body(first), on_body(other))


def test_slips_have_the_stated_sizes_about_the_first_contacts() -> None:
    slips = []
    for seed in range(12):
        data = simulate("hexagon", seed, motion_scale=0.5)
        middle = data.grasps[0].points_world_m.mean(axis=0)
        frame = data.world_T_body[0].transformTo(middle)
        for before, after, grasp in zip(data.world_T_body, data.world_T_body[1:], data.grasps[1:], strict=False):
            slip = (grasp.hand_motion_world * before).between(after)
            moved = slip.transformFrom(frame) - frame
            slips.append([moved[0], moved[1], slip.rotation().yaw()])
    assert np.std(slips, axis=0) == pytest.approx([0.005, 0.005, np.deg2rad(10)], rel=0.15)


def test_outliers_are_as_frequent_as_asked() -> None:
    data = simulate("ellipse", 2, count=100, outlier_share=0.1)
    off = distances_to_polygon(on_body(data)[:, :2], data.outline_m) > 0.004
    assert 0.03 < off.mean() < 0.1


def test_random_contacts_cover_the_whole_outline() -> None:
    data = random_contacts("square", 80, seed=1)
    points = on_body(data)
    assert len(points) == 80
    assert all(len(grasp.contacts) == 5 for grasp in data.grasps)
    assert distances_to_polygon(points[:, :2], data.outline_m).max() < 0.004
    assert [np.ptp(points[:, axis]) for axis in (0, 1)] == pytest.approx([0.07, 0.07], abs=0.006)
    assert len(random_contacts("square", 13, seed=1).grasps[-1].contacts) == 3


def test_a_ray_that_ends_before_the_outline_meets_nothing() -> None:
    outline, way = OUTLINES_m["square"], np.array([1.0, 0.0])
    hit = first_crossing(outline, np.array([-0.1, 0.01]), way)
    assert hit is not None
    assert np.allclose(hit[0], [-0.035, 0.01])
    assert np.allclose(hit[1], [-1, 0])
    assert first_crossing(outline, np.array([-0.1, 0.01]), way, longest_m=0.06) is None
    assert first_crossing(outline, np.array([-0.1, 0.04]), way) is None


def test_an_unknown_shape_is_named_with_those_there_are() -> None:
    with pytest.raises(ConfigurationError, match="octagon") as caught:
        simulate("octagon", 0)
    assert "stadium" in str(caught.value.hint)
