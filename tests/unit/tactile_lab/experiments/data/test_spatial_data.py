"""Simulated contacts in space: where they lie, what is free space, and that they repeat."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from drivers.core.errors import ConfigurationError
from drivers.core.poses import rotate, transform_points
from tactile_lab.experiments.data.solids import SOLIDS, YCB_NAMES, solid
from tactile_lab.experiments.data.spatial_data import SpatialGrasps, random_contacts, simulate
from tactile_lab.slam.shape.surfaces.sampling import distances_to_mesh


def on_body(data: SpatialGrasps) -> np.ndarray:
    pairs = zip(data.grasps, data.world_T_body, strict=True)
    return np.concatenate([transform_points(pose.inverse(), grasp.points_world_m) for grasp, pose in pairs])


@pytest.mark.parametrize("name", SOLIDS)
def test_solids_are_closed_and_have_a_graspable_size(name: str) -> None:
    mesh = solid(name).mesh
    assert mesh.is_watertight
    assert mesh.volume > 9e-5
    assert np.all(mesh.extents < 0.15)


@pytest.mark.parametrize("motion", ["table", "free"])
@pytest.mark.parametrize("name", ["box-12x6x6", "l-block", "mug"])
def test_contacts_lie_on_the_surface_within_the_sensors_noise(name: str, motion: str) -> None:
    data = simulate(name, 0, motion=motion)
    points = on_body(data)
    assert len(data.grasps) == 24
    assert len(points) > 100
    rms = np.sqrt(np.mean(distances_to_mesh(points, data.mesh) ** 2))
    assert 0.0008 < rms < 0.0012


def test_objects_on_the_table_stay_upright_on_it() -> None:
    data = simulate("cylinder", 2)
    for pose in data.world_T_body:
        assert pose.z() == pytest.approx(0.030)
        assert np.allclose(pose.rotation().matrix()[2], [0, 0, 1])
    assert all(grasp.points_world_m[:, 2].min() > -0.003 for grasp in data.grasps)


def test_free_motion_turns_about_all_axes() -> None:
    data = simulate("cylinder", 2, motion="free")
    tilts = [pose.rotation().matrix()[2, 2] for pose in data.world_T_body]
    assert np.ptp(tilts) > 0.5


def test_grasps_on_the_table_reach_three_heights_and_the_top() -> None:
    data = simulate("box-12x6x6", 1)
    heights = [np.median(grasp.points_world_m[:, 2]) for grasp in data.grasps]
    levels = [np.median(heights[level::3]) for level in range(3)]
    assert levels[0] < levels[1] < levels[2]
    normals = np.concatenate([grasp.normals_world for grasp in data.grasps])
    assert 0.08 < np.mean(normals[:, 2] > 0.9) < 0.45


@pytest.mark.parametrize("motion", ["table", "free"])
def test_closing_lines_are_outside_until_the_contact(motion: str) -> None:
    data = simulate("box-12x6x6", 3, motion=motion)
    half = data.mesh.extents / 2
    for grasp, pose in zip(data.grasps, data.world_T_body, strict=True):
        assert len(grasp.approach_paths) == 5
        for line in grasp.approach_paths:
            way = line.start_world_m - line.end_world_m
            length = np.linalg.norm(way)
            before = line.end_world_m + np.outer(np.linspace(0.012 if line.touched else 0.0, length, 60), way / length)
            assert not np.all(np.abs(transform_points(pose.inverse(), before)) < half, axis=1).any()
            assert motion == "free" or line.end_world_m[2] > -0.003


def test_normals_point_out_of_the_object() -> None:
    data = simulate("sphere", 0)
    for grasp, pose in zip(data.grasps, data.world_T_body, strict=True):
        points = transform_points(pose.inverse(), grasp.points_world_m)
        normals = rotate(pose.inverse(), grasp.normals_world)
        cosines = np.sum(points * normals, axis=1) / np.linalg.norm(points, axis=1)
        assert cosines.min() > np.cos(np.deg2rad(25))


def test_a_seed_gives_the_same_data() -> None:
    first, second = (simulate("mug", 7, count=4) for _ in range(2))
    assert np.array_equal(on_body(first), on_body(second))


def test_random_contacts_leave_out_the_foot() -> None:
    data = random_contacts("box-12x6x6", 80, seed=0)
    points = on_body(data)
    assert len(points) == 80
    assert distances_to_mesh(points, data.mesh).max() < 0.005
    assert points[:, 2].min() > -0.030
    assert np.ptp(points[:, 0]) > 0.11
    everywhere = on_body(random_contacts("box-12x6x6", 80, seed=0, foot=True))
    assert np.sum(everywhere[:, 2] < -0.028) > 10


def test_scanned_objects_are_read_from_the_data_folder(lab_data: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TACTILE_LAB_DATA", str(lab_data))
    solid.cache_clear()
    data = simulate(f"ycb:{YCB_NAMES[3]}", 0, count=3)
    assert isinstance(data.mesh, trimesh.Trimesh)
    assert distances_to_mesh(on_body(data), data.mesh).max() < 0.005


def test_absent_scans_and_unknown_names_are_explained(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    solid.cache_clear()
    monkeypatch.delenv("TACTILE_LAB_DATA", raising=False)
    with pytest.raises(ConfigurationError, match="ycb:mug"):
        simulate("ycb:mug", 0)
    monkeypatch.setenv("TACTILE_LAB_DATA", str(tmp_path))
    with pytest.raises(ConfigurationError, match=r"ycb_mug\.ply"):
        simulate("ycb:mug", 0)
    with pytest.raises(ConfigurationError, match="teapot"):
        simulate("teapot", 0)
