"""A rigid body as a USD stage, with the physics schemas that Isaac Sim and Omniverse read.

Package ``usd-core`` is an extra: without it the other formats are written.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from drivers.core.errors import ConfigurationError
from drivers.core.installed.extras import install_command
from tactile_lab.models.solid_model import SolidModel

try:
    from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics, UsdShade, Vt
except ImportError:
    Usd = None

USD_INSTALLED = Usd is not None


def write_usd(path: Path, model: SolidModel) -> None:
    """Write a ``.usda`` stage whose default prim is the body; its frame is the model's.

    Raises:
        ConfigurationError: package usd-core is not installed.
    """
    if not USD_INSTALLED:
        hint = f"Install it: {install_command('usd')}; or choose other formats"
        raise ConfigurationError("needs the package usd-core", where="--format usd", hint=hint)
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    body = UsdGeom.Xform.Define(stage, f"/{model.name.replace('-', '_')}")
    body.GetPrim().SetCustomDataByKey("tactile_lab", _without_lists(model.as_json()))
    stage.SetDefaultPrim(body.GetPrim())
    _add_mass(body.GetPrim(), model)
    _add_surface(stage, body.GetPath(), model)
    _add_parts(stage, body.GetPath(), model)
    stage.GetRootLayer().Save()


def _add_mass(prim: Any, model: SolidModel) -> None:
    UsdPhysics.RigidBodyAPI.Apply(prim)
    moments, axes = np.linalg.eigh(model.inertia_kg_m2)
    axes[:, 2] *= np.linalg.det(axes)
    x, y, z, w = Rotation.from_matrix(axes).as_quat().tolist()
    mass = UsdPhysics.MassAPI.Apply(prim)
    mass.CreateMassAttr(model.mass_kg)
    mass.CreateCenterOfMassAttr(Gf.Vec3f(*model.centre_m.tolist()))
    mass.CreateDiagonalInertiaAttr(Gf.Vec3f(*moments.tolist()))
    mass.CreatePrincipalAxesAttr(Gf.Quatf(w, x, y, z))


def _add_surface(stage: Any, body: Any, model: SolidModel) -> None:
    mesh = _add_mesh(stage, body.AppendChild("visual"), model.surface)
    sigma = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("sigma_m", Sdf.ValueTypeNames.FloatArray, UsdGeom.Tokens.vertex)
    sigma.Set(Vt.FloatArray.FromNumpy(model.sigma_m.astype(np.float32)))


def _add_parts(stage: Any, body: Any, model: SolidModel) -> None:
    material = UsdShade.Material.Define(stage, body.AppendChild("contact"))
    friction = UsdPhysics.MaterialAPI.Apply(material.GetPrim())
    friction.CreateStaticFrictionAttr(model.friction)
    friction.CreateDynamicFrictionAttr(model.friction)
    for number, part in enumerate(model.parts):
        mesh = _add_mesh(stage, body.AppendChild(f"part_{number}"), part)
        mesh.CreatePurposeAttr(UsdGeom.Tokens.guide)
        UsdPhysics.CollisionAPI.Apply(mesh.GetPrim())
        UsdPhysics.MeshCollisionAPI.Apply(mesh.GetPrim()).CreateApproximationAttr(UsdPhysics.Tokens.convexHull)
        UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(material, materialPurpose="physics")


def _add_mesh(stage: Any, path: Any, mesh: trimesh.Trimesh) -> Any:
    made = UsdGeom.Mesh.Define(stage, path)
    made.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(np.asarray(mesh.vertices, np.float32)))
    made.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(mesh.faces), 3, np.int32)))
    made.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(np.asarray(mesh.faces, np.int32).ravel()))
    made.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    return made


def _without_lists(told: dict[str, Any]) -> dict[str, Any]:
    """Nested lists of numbers as text: custom data holds plain values only."""
    return {
        key: _without_lists(value) if isinstance(value, dict) else str(value) if isinstance(value, list) else value
        for key, value in told.items()
    }
