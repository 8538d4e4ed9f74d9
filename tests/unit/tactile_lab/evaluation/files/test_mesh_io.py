"""Meshes through files: what is written is read back, and what cannot be used is refused with the reason."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from drivers.core.errors import ShapeError, WriteError
from tactile_lab.evaluation.files.mesh_io import COLOUR_RANGE_m, read_mesh, sigma_colours, write_glb, write_ply
from tactile_lab.slam.shape.surfaces.surface import SurfaceMesh


@pytest.fixture
def surface() -> SurfaceMesh:
    ball = trimesh.creation.icosphere(2, 0.03)
    sigma_m = np.linspace(0.0, 0.012, len(ball.vertices))
    return SurfaceMesh(ball.vertices, ball.faces, sigma_m, ball.vertices / 0.03, is_closed=True)


def test_ply_keeps_vertices_exactly_and_carries_sigma_and_colours(surface: SurfaceMesh, tmp_path: Path) -> None:
    write_ply(tmp_path / "mesh.ply", surface)
    raw = trimesh.load_mesh(tmp_path / "mesh.ply", process=False)
    np.testing.assert_array_equal(raw.vertices, surface.vertices)
    np.testing.assert_array_equal(raw.faces, surface.faces)
    np.testing.assert_array_equal(raw.visual.vertex_colors, sigma_colours(surface.sigma_m))
    vertex = raw.metadata["_ply_raw"]["vertex"]["data"]
    np.testing.assert_allclose(np.ravel(vertex["sigma_m"]), surface.sigma_m, rtol=1e-6)
    assert read_mesh(tmp_path / "mesh.ply").is_watertight


def test_glb_is_read_back_closed_with_its_colours(surface: SurfaceMesh, tmp_path: Path) -> None:
    write_glb(tmp_path / "mesh.glb", surface)
    found = read_mesh(tmp_path / "mesh.glb")
    assert found.volume == pytest.approx(4 / 3 * np.pi * 0.03**3, rel=0.05)
    content = (tmp_path / "mesh.glb").read_bytes()
    description = json.loads(content[20 : 20 + int.from_bytes(content[12:16], "little")])
    assert {"POSITION", "NORMAL", "COLOR_0"} <= set(description["meshes"][0]["primitives"][0]["attributes"])


def test_a_closed_mesh_stays_closed_where_two_of_its_vertices_are_at_one_place(
    surface: SurfaceMesh, tmp_path: Path
) -> None:
    one, other = surface.faces[0, :2]
    vertices = surface.vertices.copy()
    vertices[other] = vertices[one]
    write_ply(tmp_path / "mesh.ply", replace(surface, vertices=vertices))
    assert len(read_mesh(tmp_path / "mesh.ply").vertices) == len(vertices)


WRITE_BOTH = """
import sys, pathlib, numpy as np
from tactile_lab.evaluation.files.mesh_io import write_glb, write_ply
from tactile_lab.slam.shape.surfaces.surface import SurfaceMesh
corners = np.array([[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.1]])
faces = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
mesh = SurfaceMesh(corners, faces, np.arange(4) * 1e-3, np.tile([0.0, 0.0, 1.0], (4, 1)), True)
write_ply(pathlib.Path(sys.argv[1]) / "mesh.ply", mesh)
write_glb(pathlib.Path(sys.argv[1]) / "mesh.glb", mesh)
"""


def test_files_are_equal_byte_for_byte_in_every_process(tmp_path: Path) -> None:
    for name in ("here", "there"):
        (tmp_path / name).mkdir()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["-c", str(tmp_path / "here")])
        exec(WRITE_BOTH, {})
    words = [sys.executable, "-c", WRITE_BOTH, str(tmp_path / "there")]
    subprocess.run(words, check=True, env={"PYTHONHASHSEED": "1"})
    for name in ("mesh.ply", "mesh.glb"):
        assert (tmp_path / "here" / name).read_bytes() == (tmp_path / "there" / name).read_bytes()


def test_colours_go_from_dark_to_bright_and_stay_there() -> None:
    colours = sigma_colours(np.array([0.0, COLOUR_RANGE_m / 2, COLOUR_RANGE_m, 1.0]))
    brightness = colours[:, :3].sum(axis=1)
    assert brightness[0] < brightness[1] < brightness[2] == brightness[3]
    assert (colours[:, 3] == 255).all()


def test_faces_turned_inward_are_turned_outward(tmp_path: Path) -> None:
    box = trimesh.creation.box((0.1, 0.06, 0.04))
    box.invert()
    box.export(tmp_path / "box.stl")
    assert read_mesh(tmp_path / "box.stl").volume == pytest.approx(0.1 * 0.06 * 0.04)


def test_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(ShapeError, match=r"nothing\.ply: file not found"):
        read_mesh(tmp_path / "nothing.ply")


@pytest.mark.parametrize(
    "name", ["foreign.ply", "foreign.stl", "foreign.obj", "foreign.glb", "foreign.mesh", "foreign"]
)
@pytest.mark.parametrize("content", [b"", b"not a mesh at all", bytes(range(256)) * 4])
def test_foreign_bytes_are_refused(tmp_path: Path, name: str, content: bytes) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(ShapeError, match="foreign"):
        read_mesh(tmp_path / name)


def test_truncated_file_is_refused(surface: SurfaceMesh, tmp_path: Path) -> None:
    write_ply(tmp_path / "mesh.ply", surface)
    content = (tmp_path / "mesh.ply").read_bytes()
    (tmp_path / "mesh.ply").write_bytes(content[: len(content) // 2])
    with pytest.raises(ShapeError, match=r"mesh\.ply"):
        read_mesh(tmp_path / "mesh.ply")


def test_open_mesh_is_refused_with_the_number_of_open_edges(tmp_path: Path) -> None:
    box = trimesh.creation.box((0.1, 0.06, 0.04))
    box.update_faces(np.arange(len(box.faces)) > 0)
    box.export(tmp_path / "box.ply")
    with pytest.raises(ShapeError, match="not closed \\(3 open edges\\)"):
        read_mesh(tmp_path / "box.ply")


def test_mesh_in_millimetres_is_refused_with_a_hint(tmp_path: Path) -> None:
    trimesh.creation.box((100, 60, 40)).export(tmp_path / "box.stl")
    with pytest.raises(ShapeError, match=r"100 m long.*millimetres"):
        read_mesh(tmp_path / "box.stl")


def test_mesh_with_nan_is_refused(tmp_path: Path) -> None:
    lines = ["v 0 0 nan", "v 0.1 0 0", "v 0 0.1 0", "v 0 0 0.1", "f 1 3 2", "f 1 2 4", "f 2 3 4", "f 1 4 3"]
    (tmp_path / "mesh.obj").write_text("\n".join(lines))
    with pytest.raises(ShapeError, match="not numbers"):
        read_mesh(tmp_path / "mesh.obj")


def test_unwritable_place_is_an_error_that_names_it(surface: SurfaceMesh, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    for write in (write_ply, write_glb):
        with pytest.raises(WriteError, match="file/mesh: cannot be written"):
            write(tmp_path / "file" / "mesh", surface)


def test_scanned_household_objects_are_closed(lab_data: Path) -> None:
    for path in sorted((lab_data / "ycb_meshes").glob("*.ply")):
        mesh = read_mesh(path)
        assert 0.05 < mesh.extents.max() < 0.3
        assert mesh.volume > 0
