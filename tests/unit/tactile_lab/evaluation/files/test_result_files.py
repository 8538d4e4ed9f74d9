"""The files of results/: content, determinism, bad input."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from gtsam import Pose2, Pose3

from drivers.core.errors import SessionError, ShapeError, WriteError
from tactile_lab.evaluation.files.plain import json_text, plain
from tactile_lab.evaluation.files.result_files import upright_contour, write_results
from tactile_lab.evaluation.files.results import read_results
from tactile_lab.evaluation.files.tables import contacts_text, contour_text, read_contacts, read_contour
from tactile_lab.evaluation.prism import open_ring, prism, signed_area_m2, triangulate
from tactile_lab.slam.result import SlamResult
from tactile_lab.slam.slam_settings import SlamSettings
from tactile_lab.slam.tactile_slam import TactileSlam
from tests.support.synthetic_grasps import Recorded, SIZE_m, box_grasps, result_of

ELL = np.array([[0, 0], [0.10, 0], [0.10, 0.03], [0.03, 0.03], [0.03, 0.06], [0, 0.06]])
ELL_AREA_m2 = 0.10 * 0.03 + 0.03 * 0.03


def run_slam(recorded: Recorded, dimension: int) -> SlamResult:
    slam = TactileSlam(SlamSettings(dimension=dimension), seed=3)
    for grasp in recorded.grasps:
        slam.add_grasp(grasp)
    return slam.finish()


@pytest.fixture(scope="module")
def recorded() -> Recorded:
    return box_grasps()


@pytest.fixture(scope="module", params=[2, 3])
def result(request: pytest.FixtureRequest) -> SlamResult:
    return result_of(request.param)


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


def test_same_result_gives_the_same_bytes(tmp_path: Path, result: SlamResult, recorded: Recorded) -> None:
    for name in ("first", "second"):
        write_results(tmp_path / name, result, recorded.grasps)
    assert contents(tmp_path / "first") == contents(tmp_path / "second")


def test_repeated_run_differs_in_its_timing_only(tmp_path: Path, recorded: Recorded) -> None:
    for name, found in (("first", result_of(2)), ("second", run_slam(recorded, 2))):
        write_results(tmp_path / name, found, recorded.grasps)
    first, second = contents(tmp_path / "first"), contents(tmp_path / "second")
    assert {name for name in first if first[name] != second[name]} <= {"timing.json"}


def test_every_promised_file_is_written(tmp_path: Path, result: SlamResult, recorded: Recorded) -> None:
    paths = write_results(tmp_path / "results", result, recorded.grasps)
    names = {"trajectory.csv", "contacts.csv", "slam.json", "timing.json", "mesh.ply", "mesh.glb"}
    assert {path.name for path in paths} == names | ({"contour.csv"} if result.dimension == 2 else set())
    assert all(path.is_file() for path in paths)


def test_what_is_known_well_is_written_apart(tmp_path: Path, result: SlamResult, recorded: Recorded) -> None:
    shape = result.contour if result.contour is not None else result.mesh
    assert shape is not None
    write_results(tmp_path, result, recorded.grasps, largest_sigma_m=float(np.quantile(shape.sigma_m, 0.6)))
    if result.contour is not None:
        rows = (tmp_path / "known.csv").read_text().splitlines()
        assert rows[0] == "piece,x_m,y_m"
        assert 0.5 * len(shape.sigma_m) < len(rows) - 1 < len(shape.sigma_m)
    else:
        known, whole = (trimesh.load_mesh(tmp_path / name) for name in ("known.ply", "mesh.ply"))
        assert 0.3 * len(whole.faces) < len(known.faces) < len(whole.faces)


def test_results_read_back(tmp_path: Path, result: SlamResult, recorded: Recorded) -> None:
    write_results(tmp_path, result, recorded.grasps, {"dimension": result.dimension})
    found = read_results(tmp_path)
    assert found.dimension == result.dimension
    assert found.slam["settings"] == {"dimension": result.dimension}
    assert found.step_seconds == pytest.approx(result.step_seconds)
    for rows, grasp in zip(found.contacts, recorded.grasps, strict=True):
        assert rows.fingers == tuple(contact.finger for contact in grasp.contacts)
        assert np.array_equal(rows.points_world_m, grasp.points_world_m)
        assert np.array_equal(rows.normals_world, grasp.normals_world)
        assert rows.point_sigma_m == pytest.approx(0.001)


def test_planar_session_ends_with_its_contour_stood_upright(tmp_path: Path, recorded: Recorded) -> None:
    result = result_of(2)
    write_results(tmp_path, result, recorded.grasps)
    contour = read_contour(tmp_path / "contour.csv").points_m
    assert signed_area_m2(contour) > 0  # counter-clockwise
    mesh = trimesh.load_mesh(tmp_path / "mesh.ply", process=False)
    assert mesh.is_watertight
    origin_height = result.world_T_object[0].z()  # type: ignore[union-attr]
    highest = max(float(grasp.points_world_m[:, 2].max()) for grasp in recorded.grasps)
    assert mesh.bounds[:, 2] == pytest.approx([-origin_height, highest - origin_height], abs=1e-6)
    assert mesh.volume == pytest.approx(signed_area_m2(contour) * highest, rel=1e-4)
    assert signed_area_m2(contour) == pytest.approx(SIZE_m[0] * SIZE_m[1], rel=0.25)


@pytest.mark.parametrize("told", [True, False])
def test_walls_of_a_contour_are_touched_where_the_contour_is(recorded: Recorded, told: bool) -> None:
    result = result_of(2)
    assert result.contour is not None
    points = result.contour.points_m
    known = points[:, 0] > points[:, 0].mean() if told else None
    solid = upright_contour(replace(result, contour=replace(result.contour, known=known)), recorded.grasps)
    assert solid is not None
    if known is None:
        assert solid.known is None
    else:
        nearest = np.linalg.norm(solid.vertices[:, None, :2] - points, axis=2).argmin(axis=1)
        assert solid.known is not None
        np.testing.assert_array_equal(solid.known, known[nearest])


def test_steps_are_told_without_durations(tmp_path: Path, recorded: Recorded) -> None:
    write_results(tmp_path, result_of(2), recorded.grasps)
    steps = json.loads((tmp_path / "slam.json").read_text())["steps"]
    assert [step["index"] for step in steps] == list(range(5))
    assert not any("seconds" in step for step in steps)


def test_folder_that_can_not_be_made_is_named(tmp_path: Path, result: SlamResult) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(WriteError, match="cannot be written"):
        write_results(tmp_path / "file" / "results", result, box_grasps().grasps)


def break_contacts(folder: Path) -> None:
    path = folder / "contacts.csv"
    path.write_text(path.read_text().replace(",FF,", ",,", 1))


def break_slam(folder: Path) -> None:
    (folder / "slam.json").write_text("[]")


def truncate_slam(folder: Path) -> None:
    (folder / "slam.json").write_text('{"method": "particle"')


def remove_keys(folder: Path) -> None:
    (folder / "slam.json").write_text('{"method": "particle", "seed": 1}')


def remove_timing(folder: Path) -> None:
    (folder / "timing.json").unlink()


@pytest.mark.parametrize("damage", [break_contacts, break_slam, truncate_slam, remove_keys, remove_timing])
def test_damaged_results_are_session_errors_with_a_hint(
    tmp_path: Path, recorded: Recorded, damage: Callable[[Path], None]
) -> None:
    write_results(tmp_path, result_of(2), recorded.grasps)
    damage(tmp_path)
    with pytest.raises(SessionError, match="Replay"):
        read_results(tmp_path)


def test_contacts_of_a_grasp_beyond_the_trajectory_are_refused(tmp_path: Path, recorded: Recorded) -> None:
    (tmp_path / "contacts.csv").write_text(contacts_text(recorded.grasps))
    with pytest.raises(SessionError, match="no such finger or grasp"):
        read_contacts(tmp_path / "contacts.csv", 3)


def test_contour_file_refuses_words(tmp_path: Path) -> None:
    (tmp_path / "contour.csv").write_text("x_m,y_m\n1.0,one\n1.0,2.0\n")
    with pytest.raises(SessionError, match="not a number"):
        read_contour(tmp_path / "contour.csv")


def test_contour_file_refuses_a_line_and_infinite_points(tmp_path: Path) -> None:
    for rows in (["0,0,0.1", "1,0,0.1", "0,0,0.1"], ["0,0,0", "1,0,0", "inf,1,0", "0,0,0"]):
        (tmp_path / "contour.csv").write_text("\n".join(["x_m,y_m,sigma_m", *rows]))
        with pytest.raises(SessionError, match="three finite points"):
            read_contour(tmp_path / "contour.csv")


def test_contour_files_of_older_versions_have_no_standard_deviations(tmp_path: Path) -> None:
    (tmp_path / "contour.csv").write_text("x_m,y_m\n0,0\n1,0\n0,1\n0,0\n")
    found = read_contour(tmp_path / "contour.csv")
    assert found.points_m.tolist() == [[0, 0], [1, 0], [0, 1]]
    assert found.sigma_m.shape == (0,)
    assert found.known.all()


def test_contour_is_closed_and_reads_back(tmp_path: Path) -> None:
    sigma_m = 1e-4 * np.arange(1.0, len(ELL) + 1)
    known = np.arange(len(ELL)) % 2 == 0
    (tmp_path / "contour.csv").write_text(contour_text(ELL, sigma_m, known))
    lines = (tmp_path / "contour.csv").read_text().splitlines()
    assert (len(lines), lines[1]) == (len(ELL) + 2, lines[-1])
    found = read_contour(tmp_path / "contour.csv")
    assert np.array_equal(found.points_m, ELL)
    assert np.array_equal(found.sigma_m, sigma_m)
    assert np.array_equal(found.known, known)


def test_ring_without_area_is_a_shape_error() -> None:
    with pytest.raises(ShapeError, match="fewer than three"):
        open_ring(np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 0.0]])[[0, 1, 0]])


def densified(ring: np.ndarray, parts: int) -> np.ndarray:
    share = np.arange(parts)[None, :, None] / parts
    return np.asarray((ring[:, None] + share * (np.roll(ring, -1, axis=0) - ring)[:, None]).reshape(-1, 2))


@pytest.mark.parametrize("parts", [1, 2, 7, 40])
def test_ears_fill_a_concave_ring_with_points_on_straight_sides(parts: int) -> None:
    ring = densified(ELL, parts)
    triangles = triangulate(ring)
    areas = [signed_area_m2(ring[triangle]) for triangle in triangles]
    assert len(triangles) == len(ring) - 2
    assert min(areas) > -1e-12
    assert sum(areas) == pytest.approx(ELL_AREA_m2)


def test_prism_is_a_closed_solid() -> None:
    vertices, faces = prism(open_ring(ELL[::-1]), -0.01, 0.03)
    solid = trimesh.Trimesh(vertices, faces, process=False)
    assert solid.is_watertight
    assert solid.volume == pytest.approx(0.04 * ELL_AREA_m2)


def test_prism_of_a_ring_that_crosses_itself_is_still_closed() -> None:
    bow = np.array([[0.0, 0.0], [0.1, 0.1], [0.1, 0.0], [0.0, 0.12]])
    vertices, faces = prism(open_ring(bow), 0.0, 0.02)
    assert trimesh.Trimesh(vertices, faces, process=False).is_watertight


@dataclass(frozen=True)
class Sample:
    pose: Pose3
    numbers: Any


def test_plain_data_has_no_nan_and_no_objects() -> None:
    value = Sample(Pose3(), np.array([[1.0, np.nan], [np.inf, 2.0]]))
    assert plain(value) == {"pose": np.eye(4).tolist(), "numbers": [[1.0, None], [None, 2.0]]}
    assert plain({"b": Path("x"), "a": (Pose2(), True, np.float64("nan"))})["a"][2] is None
    assert json.loads(json_text({"key": float("nan")})) == {"key": None}
    with pytest.raises(TypeError, match="object"):
        plain(object())
