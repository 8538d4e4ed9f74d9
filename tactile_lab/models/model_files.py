"""Writes a rigid body's files: meshes, descriptions for simulators, and what is known of it.

==================  =========================================================================
``surface.stl``     the surface, for CAD and printing
``visual.obj``      the same, for simulators
``surface.glb``     the same, coloured by its standard deviation
``part_N.obj``      convex parts for collisions
``NAME.urdf``       ROS, PyBullet, Drake, Isaac
``NAME.sdf``        Gazebo, Drake
``NAME.xml``        MuJoCo: the body on a floor
``NAME.usda``       Isaac Sim, Omniverse, Blender
``model.json``      mass, centre, inertia, friction and the uncertainty of the surface
==================  =========================================================================
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from enum import StrEnum
from pathlib import Path
from tempfile import TemporaryDirectory
from types import MappingProxyType

import trimesh

from drivers.core.atomic_files import refuse_existing, write_whole, writing_into
from tactile_lab.evaluation.files.mesh_io import write_glb
from tactile_lab.evaluation.files.plain import json_text
from tactile_lab.models.robot_files import VISUAL_FILE, mjcf, part_file, sdf, urdf
from tactile_lab.models.solid_model import SolidModel
from tactile_lab.models.usd_file import USD_INSTALLED, write_usd
from tactile_lab.slam.shape.surfaces.surface import SurfaceMesh


class Format(StrEnum):
    """Kinds of files that a model can be written as."""

    STL = "stl"
    OBJ = "obj"
    GLB = "glb"
    URDF = "urdf"
    SDF = "sdf"
    MJCF = "mjcf"
    USD = "usd"


def formats_installed() -> tuple[Format, ...]:
    """All formats that can be written with the packages installed here."""
    return tuple(each for each in Format if each is not Format.USD or USD_INSTALLED)


def write_model(folder: Path, model: SolidModel, formats: Sequence[Format]) -> list[Path]:
    """Write a model's files to a new folder, all or none of them.

    Returns:
        The files, by name.

    Raises:
        ConfigurationError: the folder exists, or a package for a format is missing.
        WriteError: the disk is full, or the folder cannot be written.
    """
    refuse_existing([folder])
    with writing_into(folder.parent):
        folder.parent.mkdir(parents=True, exist_ok=True)
        with TemporaryDirectory(prefix=f".{folder.name}-", dir=folder.parent) as unfinished:
            place = Path(unfinished) / folder.name
            place.mkdir()
            _write_all(place, model, set(formats))
            place.rename(folder)
    return sorted(folder.iterdir())


def _write_all(folder: Path, model: SolidModel, formats: Collection[Format]) -> None:
    texts = [_TEXTS[each] for each in formats if each in _TEXTS]
    alone = {each for each in formats if each in _WRITERS} | ({Format.OBJ} if texts else set())
    for each in alone:
        _WRITERS[each](folder, model)
    if texts:
        _write_parts(folder, model)
    for suffix, text in texts:
        write_whole(folder / f"{model.name}.{suffix}", text(model))
    write_whole(folder / "model.json", json_text(model.as_json()))


def _obj(mesh: trimesh.Trimesh) -> str:
    return str(mesh.export(file_type="obj", include_normals=False, include_color=False, digits=9))


def _write_stl(folder: Path, model: SolidModel) -> None:
    content = model.surface.export(file_type="stl")
    assert isinstance(content, bytes)  # of this format
    write_whole(folder / "surface.stl", content)


def _write_obj(folder: Path, model: SolidModel) -> None:
    write_whole(folder / VISUAL_FILE, _obj(model.surface))


def _write_glb(folder: Path, model: SolidModel) -> None:
    surface = model.surface
    mesh = SurfaceMesh(surface.vertices, surface.faces, model.sigma_m, surface.vertex_normals, is_closed=True)
    write_glb(folder / "surface.glb", mesh)


def _write_parts(folder: Path, model: SolidModel) -> None:
    for number, part in enumerate(model.parts):
        write_whole(folder / part_file(number), _obj(part))


def _write_usd(folder: Path, model: SolidModel) -> None:
    write_usd(folder / f"{model.name}.usda", model)


_WRITERS: Mapping[Format, Callable[[Path, SolidModel], None]] = MappingProxyType(
    {Format.STL: _write_stl, Format.OBJ: _write_obj, Format.GLB: _write_glb, Format.USD: _write_usd}
)
_TEXTS: Mapping[Format, tuple[str, Callable[[SolidModel], str]]] = MappingProxyType(
    {Format.URDF: ("urdf", urdf), Format.SDF: ("sdf", sdf), Format.MJCF: ("xml", mjcf)}
)
"""Suffix and text of the formats that name mesh files beside them."""
