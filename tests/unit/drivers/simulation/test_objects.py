"""The catalogue of the simulated rig, and objects from mesh files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.spatial import ConvexHull

from drivers.core.errors import ConfigurationError
from drivers.simulation.object_names import headline, in_pose
from drivers.simulation.objects import CATALOGUE, QUIET_ZONE, Hull, ObjectModel, Solid, object_model

NAMES = tuple(CATALOGUE)
EXTENTS_mm = {
    "box-10x6x4": (100, 60, 40),
    "box-12x6x6": (120, 60, 60),
    "cube-6": (60, 60, 60),
    "triangular-prism": (95.26, 82.5, 50),
    "hexagonal-prism": (84, 72.75, 50),
    "elliptic-cylinder": (100, 60, 50),
    "l-block": (100, 80, 50),
    "cylinder": (64, 64, 60),
    "sphere": (70, 70, 70),
}


def piece_volume_m3(piece: Solid | Hull) -> float:
    if isinstance(piece, Hull):
        return float(ConvexHull(piece.vertices_object_m).volume)
    size = piece.size_m
    volumes = {"box": 8 * np.prod(size), "sphere": 4 / 3 * np.pi * size[0] ** 3}
    volumes["cylinder"] = 2 * np.pi * size[0] ** 2 * size[-1]
    return float(volumes[piece.kind])


def polygon_area_m2(polygon: np.ndarray) -> float:
    x, y = polygon.T
    return float(0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


@pytest.mark.parametrize("name", NAMES)
def test_truth_mesh_is_watertight_with_the_stated_size(name: str) -> None:
    model = object_model(name)
    assert model.mesh.is_watertight
    assert model.mesh.volume > 0
    np.testing.assert_allclose(model.mesh.extents * 1e3, EXTENTS_mm[name], atol=0.2)


@pytest.mark.parametrize("name", NAMES)
def test_object_frame_is_at_the_centre_of_volume(name: str) -> None:
    model = object_model(name)
    np.testing.assert_allclose(model.mesh.center_mass, 0, atol=1e-9)
    assert model.rest_height_m == pytest.approx(-model.mesh.bounds[0, 2])


@pytest.mark.parametrize("name", NAMES)
def test_pieces_fill_the_truth_mesh(name: str) -> None:
    model = object_model(name)
    assert sum(map(piece_volume_m3, model.pieces)) == pytest.approx(model.mesh.volume, rel=4e-3)


@pytest.mark.parametrize("name", [name for name in NAMES if name != "sphere"])
def test_the_foot_of_a_prism_encloses_the_volume_over_the_height(name: str) -> None:
    model = object_model(name)
    assert polygon_area_m2(model.foot_object_m) * model.height_m == pytest.approx(model.mesh.volume, rel=1e-9)


def test_sphere_rolls() -> None:
    sphere = object_model("sphere")
    assert sphere.rolls
    assert sphere.marker.side_m < object_model("box-10x6x4").marker.side_m


@pytest.mark.parametrize("name", [name for name in NAMES if name not in ("sphere", "l-block")])
def test_marker_with_its_border_lies_inside_the_foot(name: str) -> None:
    model = object_model(name)
    hull = ConvexHull(model.foot_object_m)
    half = model.marker.side_m * QUIET_ZONE / 2
    corners = np.array([[a, b] for a in (-half, half) for b in (-half, half)]) + model.marker.centre_object_m[:2]
    assert np.all(corners @ hull.equations[:, :2].T + hull.equations[:, 2] <= 1e-9)
    assert model.marker.centre_object_m[2] == pytest.approx(-model.rest_height_m)


def test_unknown_object_is_refused_with_the_catalogue() -> None:
    with pytest.raises(ConfigurationError, match=r"there is no object 'teapot'.*cube-6.*mesh:<path>"):
        object_model("teapot")


def written(mesh: trimesh.Trimesh, folder: Path, suffix: str = "ply") -> str:
    path = folder / f"part.{suffix}"
    mesh.export(path)
    return f"mesh:{path}"


def test_mesh_file_becomes_an_object_about_its_centre_of_volume(tmp_path: Path) -> None:
    cone = trimesh.creation.cone(radius=0.03, height=0.06)
    model = object_model(written(cone, tmp_path))
    np.testing.assert_allclose(model.mesh.center_mass, 0, atol=1e-9)
    assert model.rest_height_m == pytest.approx(0.015, abs=1e-6)


def test_mesh_that_cannot_stand_as_given_is_laid_down(tmp_path: Path) -> None:
    needle = trimesh.creation.box((0.02, 0.03, 0.09))
    needle.apply_transform(trimesh.transformations.rotation_matrix(np.radians(40), [1, 0, 0]))
    model = object_model(written(needle, tmp_path))
    assert model.height_m == pytest.approx(0.02, abs=1e-6)
    assert len(ConvexHull(model.foot_object_m).vertices) == 4


def test_mesh_that_leans_a_little_is_stood_upright(tmp_path: Path) -> None:
    block = trimesh.creation.box((0.04, 0.03, 0.06))
    block.apply_transform(trimesh.transformations.rotation_matrix(np.radians(4), [1, 1, 0]))
    model = object_model(written(block, tmp_path))
    np.testing.assert_allclose(model.mesh.extents, (0.04, 0.03, 0.06), atol=2e-4)


@pytest.mark.parametrize(
    ("mesh", "message"),
    [
        (trimesh.creation.box((60, 40, 30)), "in millimetres"),
        (trimesh.creation.box((0.006, 0.004, 0.003)), "scaled from millimetres twice"),
        (trimesh.Trimesh([[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0]], [[0, 1, 2]]), "not a closed surface"),
    ],
)
def test_unusable_mesh_is_refused_with_a_hint(mesh: trimesh.Trimesh, message: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match=message) as caught:
        object_model(written(mesh, tmp_path))
    assert "part.ply" in str(caught.value)


@pytest.mark.parametrize("content", [b"", b"ply\nthis is not one\n", b"\x00\xff" * 40])
def test_unreadable_mesh_file_is_refused(content: bytes, tmp_path: Path) -> None:
    (tmp_path / "broken.ply").write_bytes(content)
    with pytest.raises(ConfigurationError, match=r"broken\.ply"):
        object_model(f"mesh:{tmp_path / 'broken.ply'}")


def test_missing_mesh_file_is_refused() -> None:
    with pytest.raises(ConfigurationError, match="file not found"):
        object_model("mesh:nowhere/bottle.ply")


def check_scan(model: ObjectModel) -> None:
    assert model.mesh.is_watertight
    assert 0.012 <= model.marker.side_m <= 0.035


@pytest.mark.parametrize(
    "name",
    [
        "tomato_soup_can",
        pytest.param("cracker_box", marks=pytest.mark.long),
        pytest.param("mustard_bottle", marks=pytest.mark.long),
    ],
)
def test_scanned_household_object_is_usable(name: str, lab_data: Path) -> None:
    check_scan(object_model(f"mesh:{lab_data / 'ycb_meshes' / f'ycb_{name}.ply'}"))


@pytest.fixture
def carton(tmp_path: Path) -> str:
    """A box of 40 x 90 x 160 mm that stands on its smallest face in the file."""
    trimesh.creation.box((0.040, 0.090, 0.160)).export(tmp_path / "carton.ply")
    return f"mesh:{tmp_path / 'carton.ply'}"


@pytest.mark.parametrize(
    ("pose", "height_m"), [("standing", 0.160), ("lying", 0.040), ("1", 0.040), ("3", 0.090), ("5", 0.160)]
)
def test_a_mesh_rests_in_the_pose_that_is_asked_for(carton: str, pose: str, height_m: float) -> None:
    """The first two of its six poses are those on its largest faces."""
    assert object_model(in_pose(carton, pose)).height_m == pytest.approx(height_m)


def test_without_a_pose_a_mesh_stands_as_in_its_file(carton: str) -> None:
    assert object_model(carton).height_m == pytest.approx(0.160)


@pytest.mark.parametrize("pose", ["0", "7"])
def test_a_pose_that_there_is_not_is_refused_with_how_many_there_are(carton: str, pose: str) -> None:
    with pytest.raises(ConfigurationError, match="rests in 6 poses"):
        object_model(in_pose(carton, pose))


def test_poses_are_for_meshes_and_have_names(carton: str) -> None:
    with pytest.raises(ConfigurationError, match="only meshes"):
        in_pose("cube-6", "lying")
    with pytest.raises(ConfigurationError, match="there is no pose 'upside-down'"):
        in_pose(carton, "upside-down")


def test_small_holes_are_closed_and_faces_turned_outward(tmp_path: Path) -> None:
    mesh = trimesh.creation.icosphere(subdivisions=2, radius=0.04)
    mesh.update_faces(np.arange(len(mesh.faces)) > 0)
    mesh.invert()
    mesh.export(tmp_path / "ball.ply")
    model = object_model(f"mesh:{tmp_path / 'ball.ply'}")
    assert model.mesh.is_watertight
    assert model.mesh.volume > 0


def test_an_open_surface_is_refused_with_what_is_open(tmp_path: Path) -> None:
    mesh = trimesh.creation.icosphere(subdivisions=2, radius=0.04)
    mesh.update_faces(mesh.triangles_center[:, 2] < 0.0)
    mesh.export(tmp_path / "bowl.ply")
    with pytest.raises(ConfigurationError, match="edges are open"):
        object_model(f"mesh:{tmp_path / 'bowl.ply'}")


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("l-block", "l-block"),
        ("mesh:/data/soup can.ply", "soup can"),
        ("mesh:cups/mug.v2.stl@lying", "mug.v2, lying"),
        ("mesh:mug.stl@3", "mug, pose 3"),
        ("mesh:/home/me@lab/cup.stl", "cup"),
    ],
)
def test_meshes_are_called_by_their_files_name(name: str, said: str) -> None:
    assert headline(name) == said
