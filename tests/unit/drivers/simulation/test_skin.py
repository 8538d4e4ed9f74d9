"""What the physics feels of a mesh: its true surface, also where that is hollow, and as soft as one body."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import igl
import mujoco
import numpy as np
import pytest
import trimesh
from gtsam import Pose2, Pose3
from scipy.spatial import ConvexHull

from drivers.core.contacts import FINGERS, Array
from drivers.simulation.calibration import SimulatedCalibration
from drivers.simulation.model import build_model
from drivers.simulation.objects import object_model
from drivers.simulation.plant import Plant
from drivers.simulation.skin import MOST_TRIANGLES, LARGEST_GAP_m, simplified, skin
from drivers.simulation.surfaces import OBJECT, RUBBER, TIP, WOOD, surface

BALL_m = 0.008


def bowl() -> trimesh.Trimesh:
    """A ball's half, 40 mm, with a hollow of 36 mm in it."""
    angles = np.linspace(0, np.pi / 2, 24)
    outside, inside = ([(r * np.sin(a), -r * np.cos(a)) for a in angles] for r in (0.040, 0.036))
    return trimesh.creation.revolve([*outside, *reversed(inside)], sections=48)


def rough_ball() -> trimesh.Trimesh:
    ball = trimesh.creation.icosphere(subdivisions=5, radius=0.03)
    ball.vertices *= 1 + 0.05 * np.random.default_rng(1).random((len(ball.vertices), 1))
    return ball


def written(mesh: trimesh.Trimesh, folder: Path, suffix: str = "ply") -> str:
    path = folder / f"part.{suffix}"
    mesh.export(path)
    return f"mesh:{path}"


SHAPES = {
    "block": trimesh.creation.box((0.08, 0.05, 0.03)),
    "ring": trimesh.creation.annulus(r_min=0.02, r_max=0.035, height=0.04, sections=24),
    "bowl": bowl(),
    "finely meshed block": trimesh.creation.box((0.08, 0.05, 0.03)).subdivide_to_size(0.002),
}


def above_m(piece: Array, places_m: Array) -> Array:
    """How far places are outside a convex piece, negative inside, shape (n,): at most their distance."""
    planes = ConvexHull(piece).equations
    return np.asarray((places_m @ planes[:, :3].T + planes[:, 3]).max(axis=1))


def nearest_m(mesh: trimesh.Trimesh, beyond_m: float) -> Array:
    """How far places so far outside a mesh, where nothing else of it is nearer, are from its nearest piece."""
    on_m, faces = trimesh.sample.sample_surface(mesh, 2000, seed=5)
    places_m = on_m + beyond_m * mesh.face_normals[faces]
    away_m2 = igl.point_mesh_squared_distance(places_m, mesh.vertices, mesh.faces.astype(np.int64))[0]
    clear = places_m[np.sqrt(away_m2) > 0.95 * beyond_m]
    return np.asarray(np.min([above_m(piece, clear) for piece in skin(mesh)], axis=0))


@pytest.mark.parametrize("mesh", SHAPES.values(), ids=SHAPES)
def test_the_felt_surface_is_the_true_one(mesh: trimesh.Trimesh) -> None:
    assert nearest_m(mesh, 0.0).max() < LARGEST_GAP_m


@pytest.mark.parametrize("mesh", SHAPES.values(), ids=SHAPES)
def test_nothing_is_felt_outside_the_mesh(mesh: trimesh.Trimesh) -> None:
    assert nearest_m(mesh, 1.5 * LARGEST_GAP_m).min() > 0


def test_a_convex_body_is_one_piece() -> None:
    assert len(SHAPES["finely meshed block"].faces) > 10_000
    assert [len(skin(SHAPES[name])) for name in ("block", "finely meshed block")] == [1, 1]


def test_a_hollow_has_far_fewer_pieces_than_triangles() -> None:
    for name in ("ring", "bowl"):
        assert len(skin(SHAPES[name])) < len(simplified(SHAPES[name]).faces) / 3


def test_a_rough_mesh_has_no_more_than_a_bounded_number() -> None:
    assert len(rough_ball().faces) > MOST_TRIANGLES
    fewer = simplified(rough_ball())
    assert len(fewer.faces) <= MOST_TRIANGLES
    assert fewer.is_watertight


def test_one_surface_from_two_files_has_one_skin(tmp_path: Path) -> None:
    first, second = (object_model(written(SHAPES["ring"], tmp_path, suffix)) for suffix in ("ply", "stl"))
    assert len(first.pieces) == len(second.pieces)


def lowest_m(mesh: trimesh.Trimesh, start_m: tuple[float, float, float]) -> float:
    """Height of a ball's lowest point after it fell on a mesh's skin and came to rest."""
    spec = mujoco.MjSpec()
    for index, corners in enumerate(skin(mesh)):
        piece = spec.add_mesh(name=f"{index}", uservert=corners.ravel())
        piece.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=f"{index}")
    ball = spec.worldbody.add_body(name="ball", pos=start_m)
    ball.add_freejoint()
    ball.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[BALL_m, 0, 0], mass=0.01)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 2000)
    return float(data.body("ball").xpos[2]) - BALL_m


def test_a_ball_falls_to_the_bottom_of_a_hollow() -> None:
    assert lowest_m(bowl(), (0.004, 0.0, 0.0)) == pytest.approx(-0.036, abs=0.0006)


def test_a_ball_falls_through_a_ring() -> None:
    assert lowest_m(SHAPES["ring"], (0.0, 0.0, 0.05)) < -0.1


def sunk_in_m(pieces: Sequence[Array], force_N: float) -> float:
    """How deep a ball that is pressed down sinks into pieces whose top is at 35 mm."""
    spec = mujoco.MjSpec()
    for index, corners in enumerate(pieces):
        spec.add_mesh(name=f"{index}", uservert=corners.ravel())
        attributes = surface(WOOD, OBJECT, TIP)
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=f"{index}", **attributes)
    ball = spec.worldbody.add_body(name="ball", pos=(0.002, 0.001, 0.0435))
    ball.gravcomp = 1
    ball.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=(0, 0, 1), damping=1.0)
    ball.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[BALL_m, 0, 0], mass=0.05, **surface(RUBBER, TIP, OBJECT))
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qfrc_applied[0] = -force_N
    mujoco.mj_step(model, data, 1000)
    return 0.035 - float(data.body("ball").xpos[2]) + BALL_m


def shell() -> trimesh.Trimesh:
    """A ball's upper half, 35 mm, with a hollow of 31 mm in it."""
    angles = np.linspace(0, np.pi / 2, 24)
    outside, inside = ([(r * np.sin(a), r * np.cos(a)) for a in angles] for r in (0.035, 0.031))
    return trimesh.creation.revolve([*inside, *reversed(outside)], sections=48)


def test_a_hollow_body_is_as_soft_as_a_solid_one() -> None:
    solid = trimesh.creation.icosphere(subdivisions=4, radius=0.035)
    pieces = skin(shell())
    assert len(pieces) > 20
    whole_m = sunk_in_m([np.asarray(solid.vertices)], 1.0)
    assert sunk_in_m(pieces, 1.0) == pytest.approx(whole_m, rel=0.25)


def test_a_mesh_stands_on_its_hull(tmp_path: Path) -> None:
    target = object_model(written(bowl(), tmp_path))
    tips = {finger: SimulatedCalibration.from_package().tip_body(finger, "nano17") for finger in FINGERS}
    plant = Plant(build_model(target, 0.3, tips, Pose3()), Pose2())
    plant.settle(1.0)
    assert plant.world_T_object.z() == pytest.approx(target.rest_height_m, abs=2e-4)
    assert plant.link_loads_N() == {}
