"""Mesh files as users have them: read, checked for size, and repaired into the closed surface of one body.

What cannot be repaired is refused, with the measured numbers and what to change.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import NDArray

from drivers.core.errors import ConfigurationError
from drivers.core.reading.bounded_files import refuse_unreachable
from drivers.core.reading.foreign_mesh import load_foreign_mesh
from drivers.simulation.mesh_parts import nearest_gap_m, outer_surface, without_inner_parts

LARGEST_m, SMALLEST_m = 0.25, 0.01
MOST_TRIANGLES = 100_000
"""Finding how a finer mesh rests on the table takes minutes, and no fingertip feels the difference."""

_UNITS_m = {"millimetres": 1e-3, "centimetres": 1e-2, "inches": 0.0254}
_SPECK = 0.01
"""Of the largest body's volume: what is smaller is a flaw of the file."""


@dataclass(frozen=True)
class MeshFile:
    """The closed surface of one body, metres, as placed in its file.

    Attributes:
        mesh: faces turned outward.
        changes: what was repaired, as sentences.
    """

    mesh: trimesh.Trimesh
    changes: tuple[str, ...] = ()


def read_mesh(path: Path) -> MeshFile:
    """Read a mesh, and repair it.

    Raises:
        ConfigurationError: the file cannot be read, has no closed surface, holds several bodies, or is not of graspable
            size.
    """
    mesh = _read(path)
    if not np.all(np.isfinite(mesh.vertices)):
        raise ConfigurationError("has vertices that are not numbers", where=str(path), hint="Export the mesh again")
    _check_size(mesh, str(path))
    changes = _close(mesh, str(path))
    body, more = _one_body(mesh, str(path))
    return MeshFile(body, (*changes, *more))


def _read(path: Path) -> trimesh.Trimesh:
    refuse_unreachable(path)
    if not path.is_file():
        raise ConfigurationError("file not found", where=str(path), hint="Check the path of the mesh")
    with warnings.catch_warnings(action="ignore"):  # numbers that are too large are told below
        mesh = load_foreign_mesh(path, force="mesh")
    if not isinstance(mesh, trimesh.Trimesh) or not len(mesh.faces):
        raise ConfigurationError("contains no triangles", where=str(path), hint="Export the object as a triangle mesh")
    if len(mesh.faces) > MOST_TRIANGLES:
        what = f"has {len(mesh.faces):,} triangles, and at most {MOST_TRIANGLES:,} are used"
        raise ConfigurationError(what, where=str(path), hint="Simplify it in a mesh editor")
    return mesh


# --- size --------------------------------------------------------------------------------------------------------


def _check_size(mesh: trimesh.Trimesh, where: str) -> None:
    largest = float(mesh.extents.max())
    if largest > LARGEST_m:
        what = f"is {_size(mesh)}, but at most {1e3 * LARGEST_m:.0f} mm fit the hand's workspace"
        raise ConfigurationError(what, where=where, hint=_unit_hint(largest))
    if largest < SMALLEST_m:
        raise ConfigurationError(
            f"is only {largest * 1e3:.3g} mm long, but the fingertips need {SMALLEST_m * 1e3:.0f} mm to hold it",
            where=where,
            hint="The unit must be the metre: was the mesh scaled from millimetres twice?",
        )


def _size(mesh: trimesh.Trimesh) -> str:
    """The extents, in metres where nobody would say millimetres."""
    factor, unit = (1.0, "m") if mesh.extents.max() > 1.0 else (1e3, "mm")
    return f"{' x '.join(f'{factor * size:.3g}' for size in mesh.extents)} {unit} large"


def _unit_hint(largest: float) -> str:
    """Whether another unit would make a number of metres a graspable size."""
    fitting = [unit for unit, unit_m in _UNITS_m.items() if SMALLEST_m <= largest * unit_m <= LARGEST_m]
    if not fitting:
        return "Take a smaller object: the arm clears none that are taller, and cannot go around longer ones"
    factors = ", ".join(f"if it is in {unit}, scale it by {_UNITS_m[unit]:g}" for unit in fitting)
    return f"The unit must be the metre: is the mesh in {' or '.join(fitting)}? {factors[0].upper()}{factors[1:]}"


# --- one closed body ---------------------------------------------------------------------------------------------


def _close(mesh: trimesh.Trimesh, where: str) -> tuple[str, ...]:
    """Close small holes and turn faces outward, in place, where the mesh needs it."""
    if mesh.is_watertight and mesh.volume > 0:
        return ()
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    mesh.update_faces(mesh.nondegenerate_faces())
    mesh.update_faces(_without_walls_between(mesh.faces))
    holes = _open_edges(mesh)
    trimesh.repair.fill_holes(mesh)
    mesh.fix_normals()
    if open_edges := _open_edges(mesh):
        what = f"is not a closed surface: {open_edges} edges are open, and filling small holes did not close it"
        raise ConfigurationError(what, where=where, hint="Repair it in a mesh editor")
    return (f"small holes were closed: {holes} edges were open",) if holes else ()


def _without_walls_between(faces: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Which faces stay: of equal ones a single one, and none where two parts lie face to face."""
    _, first, group = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_inverse=True)
    a, b, c = faces.T
    way_round = np.sign((b - a) * (c - b) * (c - a))
    is_wall = (np.bincount(group.ravel()) > 1) & (np.bincount(group.ravel(), way_round) == 0)
    stays = np.zeros(len(faces), dtype=bool)
    stays[first[~is_wall]] = True
    return stays


def _open_edges(mesh: trimesh.Trimesh) -> int:
    _, uses = np.unique(mesh.edges_sorted, axis=0, return_counts=True)
    return int(np.count_nonzero(uses == 1))


def _one_body(mesh: trimesh.Trimesh, where: str) -> tuple[trimesh.Trimesh, tuple[str, ...]]:
    """The only body, its parts merged, without specks and without what lies inside; and what that changed."""
    parts: list[trimesh.Trimesh] = list(mesh.split(only_watertight=False)) if mesh.is_watertight else [mesh]
    outer = without_inner_parts(parts)
    changes = [f"{_count(len(parts) - len(outer), 'part')} inside it left out"] if len(outer) < len(parts) else []
    if len(outer) == 1 and outer[0].is_watertight:
        return outer[0], tuple(changes)
    bodies = sorted(outer_surface(outer), key=lambda body: -body.volume)
    large = [body for body in bodies if body.volume > _SPECK * bodies[0].volume]
    if not large:
        raise ConfigurationError("encloses no volume", where=where, hint="Export the object as a closed surface")
    if len(large) > 1:
        gap_mm = 1e3 * nearest_gap_m(large[0], large[1:])
        what = f"holds {len(large)} separate bodies; the nearest stands {gap_mm:.0f} mm from the largest"
        raise ConfigurationError(what, where=where, hint="One object is explored at a time: keep only one of them")
    specks = [f"{_count(len(bodies) - 1, 'speck')} left out"] if len(bodies) > 1 else []
    merged = f"{_count(len(outer), 'part')} merged into one surface"
    return large[0], (*changes, merged, *specks)


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"
