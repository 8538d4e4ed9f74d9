"""Mesh files as users have them: repaired where that is safe, refused with numbers where it is not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from drivers.core.errors import ConfigurationError
from drivers.simulation import mesh_file
from drivers.simulation.mesh_file import MeshFile, read_mesh
from drivers.simulation.objects import object_height_m, object_model


def box(size_m: tuple[float, float, float], centre_m: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> trimesh.Trimesh:
    mesh = trimesh.creation.box(size_m)
    mesh.apply_translation(centre_m)
    return mesh


BLOCK = box((0.05, 0.05, 0.08))


def written(folder: Path, *parts: trimesh.Trimesh) -> Path:
    path = folder / "part.ply"
    trimesh.util.concatenate(list(parts)).export(path)
    return path


def read(folder: Path, *parts: trimesh.Trimesh) -> MeshFile:
    return read_mesh(written(folder, *parts))


@pytest.mark.parametrize(
    ("size", "words"),
    [
        ((60, 40, 30), ("60 x 40 x 30 m large", "at most 250 mm", "in millimetres, scale it by 0.001")),
        ((12, 4, 3), ("in centimetres, scale it by 0.01",)),
        ((0.05, 0.05, 0.3), ("50 x 50 x 300 mm large", "smaller object")),
    ],
)
def test_what_is_too_large_is_refused_with_its_size_and_the_unit_it_may_have(size, words, tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError) as caught:
        read(tmp_path, box(size))
    assert all(word in str(caught.value) for word in words)


def test_an_object_a_little_too_long_is_not_taken_for_one_in_millimetres(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError) as caught:
        read(tmp_path, box((0.05, 0.05, 0.3)))
    assert "millimetres" not in str(caught.value)


def test_two_objects_are_refused_with_the_gap_between_them(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match=r"2 separate bodies; the nearest stands 70 mm .* keep only one"):
        read(tmp_path, box((0.05, 0.05, 0.05)), box((0.04, 0.04, 0.04), (0.115, 0.0, 0.0)))


def test_parts_that_cut_through_one_another_become_one_surface(tmp_path: Path) -> None:
    """A block of 200 cm³ with a bar of 24 cm³ of which 6 cm³ are in the block."""
    found = read(tmp_path, BLOCK, box((0.06, 0.02, 0.02), (0.04, 0.0, 0.0)))
    assert found.mesh.is_watertight
    assert found.mesh.body_count == 1
    assert found.mesh.volume == pytest.approx(218e-6, rel=0.01)
    np.testing.assert_allclose(found.mesh.bounds, [[-0.025, -0.025, -0.04], [0.07, 0.025, 0.04]], atol=5e-4)
    assert found.changes == ("2 parts merged into one surface",)


def test_parts_that_share_an_edge_become_one_surface(tmp_path: Path) -> None:
    mesh = trimesh.util.concatenate([box((0.04, 0.04, 0.04)), box((0.04, 0.04, 0.04), (0.04, 0.04, 0.0))])
    mesh.merge_vertices()
    found = read(tmp_path, mesh)
    assert found.mesh.is_watertight
    assert found.mesh.volume == pytest.approx(128e-6, rel=0.01)


@pytest.mark.parametrize("is_hollow", [False, True])
def test_what_lies_inside_is_left_out_and_the_outside_stays_exact(is_hollow: bool, tmp_path: Path) -> None:
    inner = box((0.02, 0.02, 0.02))
    if is_hollow:
        inner.invert()
    found = read(tmp_path, BLOCK, inner)
    assert found.mesh.volume == pytest.approx(200e-6, rel=1e-6)
    assert found.changes == ("1 part inside it left out",)


def test_parts_that_lie_face_to_face_become_one_surface(tmp_path: Path) -> None:
    """Two copies of a face between them, one turned over, are no doubles of one face."""
    thin_m = 0.0006
    slices = [box((thin_m, 0.05, 0.04), (thin_m * place, 0.0, 0.0)) for place in range(6)]
    for mirrored in slices[1::2]:
        mirrored.vertices[:, 0] = 2 * mirrored.vertices[:, 0].mean() - mirrored.vertices[:, 0]
        mirrored.invert()
    body = read(tmp_path, *slices, box((0.03, 0.05, 0.04), (0.015 + 5.5 * thin_m, 0.0, 0.0))).mesh
    assert body.is_watertight
    assert body.volume == pytest.approx((0.03 + 6 * thin_m) * 0.05 * 0.04, rel=0.01)


@pytest.mark.parametrize("times", [2, 3])
def test_a_surface_that_was_exported_more_than_once_counts_once(times: int, tmp_path: Path) -> None:
    body = read(tmp_path, *times * [BLOCK]).mesh
    assert body.volume == pytest.approx(BLOCK.volume, rel=1e-6)


def test_a_closed_hole_is_told(tmp_path: Path) -> None:
    mesh = BLOCK.copy()
    mesh.update_faces(np.arange(12) > 0)
    assert read(tmp_path, mesh).changes == ("small holes were closed: 3 edges were open",)


def test_a_sound_mesh_stays_as_it_is(tmp_path: Path) -> None:
    found = read(tmp_path, BLOCK)
    assert found.changes == ()
    assert len(found.mesh.faces) == 12


def test_a_mesh_of_too_many_triangles_is_refused_with_their_number(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(mesh_file, "MOST_TRIANGLES", 11)
    with pytest.raises(ConfigurationError, match=r"12 triangles, and at most 11 .*Simplify"):
        read(tmp_path, BLOCK)


@pytest.mark.parametrize(("centre_m", "words"), [(1.0, "lowered by 960 mm"), (0.0, "raised by 40 mm"), (0.04, None)])
def test_a_mesh_that_floats_or_is_sunk_is_set_on_the_table_and_that_is_told(
    centre_m: float, words: str | None, tmp_path: Path
) -> None:
    model = object_model(f"mesh:{written(tmp_path, box((0.05, 0.05, 0.08), (0.0, 0.0, centre_m)))}")
    assert model.rest_height_m == pytest.approx(0.04, abs=1e-6)
    assert bool(model.changes) == (words is not None)
    assert words is None or words in model.changes[0]


def test_the_height_of_an_object_is_known_without_its_pieces(tmp_path: Path) -> None:
    assert object_height_m(f"mesh:{written(tmp_path, BLOCK)}") == pytest.approx(0.08)
    assert object_height_m("cube-6") == pytest.approx(0.06)


def test_a_fine_ball_is_set_on_the_table_in_seconds(tmp_path: Path) -> None:
    """Each of its 20,480 facets would be a pose."""
    ball = trimesh.creation.icosphere(subdivisions=5, radius=0.04)
    assert object_height_m(f"mesh:{written(tmp_path, ball)}") == pytest.approx(0.08, abs=2e-4)
