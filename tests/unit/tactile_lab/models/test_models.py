"""Exported models, opened by the programs they are for."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as ET

import mujoco
import numpy as np
import pytest
import trimesh
import yourdfpy
from pxr import Usd, UsdGeom, UsdPhysics

from drivers.core.errors import ConfigurationError, SessionDataError
from sessions.perception.weighing.value import Value
from tactile_lab.evaluation.files.mesh_io import write_ply
from tactile_lab.evaluation.files.properties_file import MeasuredBody
from tactile_lab.evaluation.prism import prism
from tactile_lab.models import usd_file
from tactile_lab.models.model_files import Format, write_model
from tactile_lab.models.solid_model import SolidModel, make_model
from tactile_lab.slam.shape.surfaces.surface import SurfaceMesh

ANGLE_m = np.array([(-0.04, -0.03), (0.04, -0.03), (0.04, 0.0), (0.0, 0.0), (0.0, 0.05), (-0.04, 0.05)])
HEIGHT_m, BASE_m = 0.06, -0.027
VOLUME_m3 = (0.08 * 0.03 + 0.04 * 0.05) * HEIGHT_m
MASS_kg, FRICTION = 0.25, 0.7
GUESSED_m = 0.008


def estimate(folder: Path) -> Path:
    """``mesh.ply`` of an angle whose origin is above its foot; a quarter of its vertices are a guess."""
    vertices, faces = prism(ANGLE_m, BASE_m, BASE_m + HEIGHT_m)
    sigma_m = np.where(np.arange(len(vertices)) % 4 == 0, GUESSED_m, 0.0005)
    normals = trimesh.Trimesh(vertices, faces, process=False).vertex_normals
    write_ply(folder / "mesh.ply", SurfaceMesh(vertices, faces, sigma_m, normals, is_closed=True))
    return folder / "mesh.ply"


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> SolidModel:
    """The angle as a rigid body."""
    return make_model(estimate(tmp_path_factory.mktemp("results")), "angle", MASS_kg, FRICTION)


@pytest.fixture(scope="module")
def folder(model: SolidModel, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """All files of the angle."""
    place = tmp_path_factory.mktemp("models") / "angle"
    write_model(place, model, list(Format))
    return place


def test_the_model_stands_on_zero_with_the_mass_of_its_volume(model: SolidModel) -> None:
    assert model.surface.bounds[0, 2] == pytest.approx(0.0, abs=1e-12)
    assert model.lowered_m == pytest.approx(-BASE_m)
    assert model.surface.volume == pytest.approx(VOLUME_m3)
    areas, middles = np.array([0.08 * 0.03, 0.04 * 0.05]), np.array([[0.0, -0.015], [-0.02, 0.025]])
    np.testing.assert_allclose(model.centre_m, [*(areas @ middles / areas.sum()), HEIGHT_m / 2], atol=1e-12)
    plates = MASS_kg * areas / areas.sum()
    sides = np.array([[0.08, 0.03], [0.04, 0.05]])
    about_z = plates @ (np.sum(sides**2, axis=1) / 12 + np.sum((middles - model.centre_m[:2]) ** 2, axis=1))
    assert model.inertia_kg_m2[2, 2] == pytest.approx(about_z)


def test_an_unknown_mass_is_assumed_and_told(tmp_path: Path) -> None:
    assumed = make_model(estimate(tmp_path), "angle")
    assert assumed.mass_is_assumed
    assert assumed.mass_kg == pytest.approx(600 * VOLUME_m3)


def test_what_was_measured_is_in_the_model_unless_somebody_states_otherwise(tmp_path: Path) -> None:
    measured = MeasuredBody(Value(0.2, 0.01), np.array([0.003, -0.004]), Value(0.35, 0.03))
    file = estimate(tmp_path)
    model = make_model(file, "angle", measured=measured)
    assert (model.mass_kg, model.mass_is_assumed, model.friction) == (0.2, False, 0.35)
    np.testing.assert_allclose(model.centre_m, [0.003, -0.004, HEIGHT_m / 2], atol=1e-12)
    assert model.body.principal().moments_sigma_kg_m2 == pytest.approx(
        np.hypot(
            replace(model, mass_sigma_kg=0.0).body.principal().moments_sigma_kg_m2,
            model.body.principal().moments_kg_m2 * 0.05,
        )
    )
    stated = make_model(file, "angle", MASS_kg, FRICTION, measured)
    assert (stated.mass_kg, stated.friction) == (MASS_kg, FRICTION)


def test_the_uncertainty_is_told_beside_the_model(folder: Path) -> None:
    told = json.loads((folder / "model.json").read_text())
    assert told["principal_inertia"]["assumes"] == "uniform density"
    assert told["guessed_share"] == pytest.approx(0.25)
    assert told["surface_sigma_m"]["largest"] == pytest.approx(GUESSED_m)
    assert (told["mass_kg"], told["mass_is_assumed"], told["friction"]) == (MASS_kg, False, FRICTION)


@pytest.mark.parametrize("file", ["surface.stl", "visual.obj", "surface.glb"])
def test_meshes_are_closed_and_keep_their_volume(folder: Path, file: str) -> None:
    mesh = trimesh.load_mesh(folder / file)
    mesh.merge_vertices(merge_norm=True, merge_tex=True)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(VOLUME_m3, rel=1e-3)


def test_mujoco_keeps_it_standing(folder: Path, model: SolidModel) -> None:
    physics = mujoco.MjModel.from_xml_path(str(folder / "angle.xml"))
    state = mujoco.MjData(physics)
    body = physics.body("angle")
    assert body.mass[0] == pytest.approx(MASS_kg)
    assert np.sort(body.inertia) == pytest.approx(np.linalg.eigvalsh(model.inertia_kg_m2), rel=1e-6)
    mujoco.mj_forward(physics, state)
    corners, largest_m = np.asarray(model.surface.vertices), 0.0
    for _ in range(round(2.0 / physics.opt.timestep)):
        mujoco.mj_step(physics, state)
        moved = corners @ state.xmat[body.id].reshape(3, 3).T + state.xpos[body.id] - corners
        largest_m = max(largest_m, float(np.linalg.norm(moved, axis=1).max()))
    assert largest_m < 0.001


@pytest.mark.filterwarnings("ignore:`Scene.dump:DeprecationWarning")  # of that reader
def test_urdf_in_an_independent_reader(folder: Path, model: SolidModel) -> None:
    robot = yourdfpy.URDF.load(str(folder / "angle.urdf"), load_collision_meshes=True, build_collision_scene_graph=True)
    inertial = robot.link_map["angle"].inertial
    assert inertial.mass == pytest.approx(MASS_kg)
    np.testing.assert_allclose(inertial.inertia, model.inertia_kg_m2, rtol=1e-6, atol=1e-15)
    np.testing.assert_allclose(robot.scene.bounds, model.surface.bounds, atol=1e-6)
    np.testing.assert_allclose(robot.collision_scene.bounds, model.surface.bounds, atol=0.001)


def test_sdf_names_files_that_are_there(folder: Path) -> None:
    root = ET.parse(folder / "angle.sdf").getroot()
    files = [uri.text or "" for uri in root.iter("uri")]
    assert files[0] == "visual.obj"
    assert len(files) > 2
    assert all((folder / file).is_file() for file in files)
    assert {mu.text for mu in root.iter("mu")} == {"0.7"}


@pytest.mark.parametrize("file", ["angle.urdf", "angle.sdf", "angle.xml"])
def test_bodies_collide_by_closed_convex_parts_as_obj(folder: Path, model: SolidModel, file: str) -> None:
    """OBJ: Drake makes no convex hull of an STL file and refuses the model."""
    named = re.findall(r"part_\d+\.\w+", (folder / file).read_text())
    assert named == [f"part_{number}.obj" for number in range(len(model.parts))]
    parts = [trimesh.load_mesh(folder / name) for name in named]
    assert all(part.is_watertight and part.is_convex for part in parts)
    assert sum(part.volume for part in parts) == pytest.approx(VOLUME_m3, rel=1e-3)


def test_usd_holds_mass_surface_and_uncertainty(folder: Path, model: SolidModel) -> None:
    stage = Usd.Stage.Open(str(folder / "angle.usda"))
    body = stage.GetDefaultPrim()
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1.0
    assert UsdPhysics.MassAPI(body).GetMassAttr().Get() == pytest.approx(MASS_kg)
    surface = UsdGeom.Mesh(stage.GetPrimAtPath(body.GetPath().AppendChild("visual")))
    faces = np.array(surface.GetFaceVertexIndicesAttr().Get()).reshape(-1, 3)
    volume = trimesh.Trimesh(np.array(surface.GetPointsAttr().Get()), faces).volume
    assert volume == pytest.approx(VOLUME_m3, rel=1e-3)
    sigma_m = np.array(UsdGeom.PrimvarsAPI(surface).GetPrimvar("sigma_m").Get())
    np.testing.assert_allclose(sigma_m, model.sigma_m, rtol=1e-6)
    assert body.GetCustomData()["tactile_lab"]["guessed_share"] == pytest.approx(0.25)
    hulls = [prim for prim in stage.Traverse() if prim.HasAPI(UsdPhysics.CollisionAPI)]
    assert len(hulls) == len(model.parts)


def test_a_session_without_a_surface_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SessionDataError, match="there is no estimated surface"):
        make_model(tmp_path / "mesh.ply", "angle")


def test_a_mesh_of_another_program_is_refused(tmp_path: Path) -> None:
    trimesh.creation.box([0.05] * 3).export(tmp_path / "mesh.ply")
    with pytest.raises(ConfigurationError, match="no standard deviations"):
        make_model(tmp_path / "mesh.ply", "angle")


def test_an_existing_folder_is_not_written_over(folder: Path, model: SolidModel) -> None:
    with pytest.raises(ConfigurationError, match="exists already"):
        write_model(folder, model, [Format.STL])


def test_without_usd_core_nothing_is_left_half_written(
    tmp_path: Path, model: SolidModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(usd_file, "USD_INSTALLED", False)
    with pytest.raises(ConfigurationError, match="needs the package usd-core"):
        write_model(tmp_path / "out", model, [Format.STL, Format.USD])
    assert list(tmp_path.iterdir()) == []
