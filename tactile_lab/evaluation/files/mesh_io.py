"""Mesh files: reads true meshes, writes estimated surfaces with their uncertainty."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from drivers.core.atomic_files import write_whole
from drivers.core.contacts import Array
from drivers.core.errors import ConfigurationError, ShapeError
from drivers.core.reading.foreign_mesh import load_foreign_mesh
from tactile_lab.colours import UNKNOWN
from tactile_lab.slam.shape.surfaces.surface import SurfaceMesh

SMALLEST_EXTENT_m, LARGEST_EXTENT_m = 0.005, 1.0
"""A hand cannot explore objects outside this range; such a mesh must be in other units."""

COLOUR_RANGE_m = 0.010
"""Standard deviation at the bright end of the colour scale; the same for all meshes, so that they can be compared."""

_COLOURS = np.array([(68, 1, 84), (59, 82, 139), (33, 145, 140), (94, 201, 98), (253, 231, 37)], dtype=float)
"""Viridis, dark (certain) to bright (uncertain)."""


_GUESS = np.append(UNKNOWN, 255.0)


def read_mesh(path: Path | str) -> trimesh.Trimesh:
    """Read a closed mesh in metres (PLY, STL, OBJ, GLB), its faces turned outward; equal vertices are merged where its
    faces do not share them.

    Raises:
        ShapeError: missing or unreadable file, no faces, coordinates that are not numbers, not closed, or an
        implausible size.
    """
    mesh = _load(Path(path))
    if len(mesh.faces) == 0:
        raise ShapeError("has no faces", where=str(path), hint="A point cloud is not enough; save it as a mesh")
    if not np.isfinite(mesh.vertices).all():
        raise ShapeError("has coordinates that are not numbers", where=str(path))
    extent_m = float(mesh.extents.max())
    if not SMALLEST_EXTENT_m <= extent_m <= LARGEST_EXTENT_m:
        hint = "Coordinates are metres; are these millimetres?" if extent_m > 1 else "Coordinates are metres"
        raise ShapeError(f"is {extent_m:.4g} m long", where=str(path), hint=hint)
    if not mesh.is_watertight:  # of one that is closed, places that happen to be the same would be torn open
        mesh.merge_vertices(merge_tex=True, merge_norm=True)
    if not mesh.is_watertight:
        raise ShapeError(
            f"is not closed ({_open_edge_count(mesh)} open edges)", where=str(path), hint="Close its holes first"
        )
    trimesh.repair.fix_normals(mesh)  # type: ignore[no-untyped-call]
    return mesh


@dataclass(frozen=True)
class EstimatedMesh:
    """An estimated surface as read from its file, metres.

    Attributes:
        mesh: closed.
        sigma_m: standard deviation at each vertex, shape (n,).
        known: of each vertex, whether it was touched nearby, shape (n,); always so in a file that does not say it.
    """

    mesh: trimesh.Trimesh
    sigma_m: Array
    known: NDArray[np.bool_]


def read_estimated_mesh(path: Path | str) -> EstimatedMesh:
    """Read an estimated surface of this program.

    Raises:
        ShapeError: as :func:`read_mesh`, or a mesh without standard deviations.
    """
    mesh = read_mesh(path)
    written = mesh.metadata.get("_ply_raw", {}).get("vertex", {}).get("data")  # reading may merge equal vertices
    if written is None or "sigma_m" not in (written.dtype.names or ()):
        raise ShapeError(
            "contains no standard deviations", where=str(path), hint="Replay the session to renew its results"
        )
    _, nearest = cKDTree(np.column_stack([written[axis] for axis in "xyz"])).query(mesh.vertices)
    known = written["known"] if "known" in written.dtype.names else np.ones(len(written))
    return EstimatedMesh(
        mesh, np.asarray(written["sigma_m"], dtype=float)[nearest], np.asarray(known, dtype=bool)[nearest]
    )


def sigma_colours(sigma_m: Array) -> NDArray[np.uint8]:
    """Colours by standard deviation, shape (n, 4), RGBA: dark is certain, bright is 10 mm or more."""
    place = np.clip(np.asarray(sigma_m) / COLOUR_RANGE_m, 0.0, 1.0) * (len(_COLOURS) - 1)
    knots = np.arange(len(_COLOURS))
    channels = [np.interp(place, knots, channel) for channel in _COLOURS.T]
    return np.column_stack([*channels, np.full(len(place), 255.0)]).round().astype(np.uint8)


def write_ply(path: Path | str, mesh: SurfaceMesh) -> None:
    """Write a binary PLY with normals, colours and the vertex properties ``sigma_m`` and ``known`` (0: a guess).

    Equal meshes give equal bytes.

    Raises:
        WriteError: the file cannot be written.
    """
    vertex_type = [(name, "<f8") for name in ("x", "y", "z")] + [(name, "<f4") for name in ("nx", "ny", "nz")]
    vertex_type += [(name, "u1") for name in ("red", "green", "blue", "alpha")] + [("sigma_m", "<f4"), ("known", "u1")]
    columns = np.column_stack([mesh.vertices, mesh.normals, _colours(mesh), mesh.sigma_m, _known(mesh)])
    vertices = np.empty(len(columns), dtype=vertex_type)
    for (name, _), column in zip(vertex_type, columns.T, strict=True):
        vertices[name] = column
    faces = np.empty(len(mesh.faces), dtype=[("count", "u1"), ("vertices", "<i4", (3,))])
    faces["count"], faces["vertices"] = 3, mesh.faces
    write_whole(Path(path), _ply_header(vertex_type, len(vertices), len(faces)) + vertices.tobytes() + faces.tobytes())


def write_glb(path: Path | str, mesh: SurfaceMesh) -> None:
    """Write a binary glTF with normals and colours by standard deviation, grey where it is a guess.

    Equal meshes give equal bytes.

    Raises:
        WriteError: the file cannot be written.
    """
    surface = trimesh.Trimesh(
        mesh.vertices,
        mesh.faces,
        vertex_normals=mesh.normals,
        vertex_colors=_colours(mesh),
        process=False,
    )
    scene = trimesh.Scene(surface)
    write_whole(Path(path), scene.export(file_type="glb", include_normals=True))  # type: ignore[no-untyped-call]


def _known(mesh: SurfaceMesh) -> NDArray[np.bool_]:
    return np.ones(len(mesh.vertices), dtype=bool) if mesh.known is None else mesh.known


def _colours(mesh: SurfaceMesh) -> NDArray[np.uint8]:
    """Colours by standard deviation, grey where the surface is a guess, shape (n, 4), RGBA."""
    return np.where(_known(mesh)[:, None], sigma_colours(mesh.sigma_m), _GUESS).astype(np.uint8)


def _load(path: Path) -> trimesh.Trimesh:
    if not path.is_file():
        raise ShapeError("file not found", where=str(path), hint="Check the path")
    try:
        mesh: trimesh.Trimesh = load_foreign_mesh(path, force="mesh", process=False)
        return mesh
    except ConfigurationError as error:
        raise ShapeError(error.what, where=str(path), hint=error.hint) from error


def _open_edge_count(mesh: trimesh.Trimesh) -> int:
    _, uses = np.unique(mesh.edges_sorted, axis=0, return_counts=True)
    return int(np.count_nonzero(uses != 2))


def _ply_header(vertex_type: list[tuple[str, str]], vertex_count: int, face_count: int) -> bytes:
    names = {"<f8": "double", "<f4": "float", "u1": "uchar"}
    lines = ["ply", "format binary_little_endian 1.0", "comment metres; sigma_m: standard deviation along the normal"]
    lines += [f"element vertex {vertex_count}", *(f"property {names[kind]} {name}" for name, kind in vertex_type)]
    lines += [f"element face {face_count}", "property list uchar int vertex_indices", "end_header"]
    return ("\n".join(lines) + "\n").encode("ascii")
