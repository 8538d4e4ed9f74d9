from __future__ import annotations

import json

import numpy as np
import pytest
import trimesh
from gtsam import Pose3, Rot3

from drivers.core.errors import SessionError
from sessions.perception.weighing.object_properties import ObjectProperties
from sessions.perception.weighing.weighing import Dragging, Hanging
from tactile_lab.evaluation.files.properties_file import PROPERTIES, read_measured, write_properties
from tactile_lab.slam.shape.surfaces.surface import SurfaceMesh

FREE = Hanging(2.94, 0.05, np.array([0.11, 0.02]), np.array([0.001, 0.001]), 0.0)
STANDING = Hanging(2.0, 0.05, np.array([0.3, 0.3]), np.array([0.001, 0.001]), 0.5)
POSES = (None, Pose3(Rot3.Yaw(np.pi / 2), np.array([0.1, 0.0, 0.0])))


def test_mass_and_centre_are_written_in_the_object_frame(tmp_path):
    found = ObjectProperties(hangings=[(0, STANDING), (1, FREE)], draggings=[(1, Dragging(1.0, 0.05, 0.0))])
    write_properties(tmp_path, found, POSES)
    record = json.loads((tmp_path / PROPERTIES).read_text())
    assert record["centre_of_mass_m"]["value"] == pytest.approx([0.02, -0.01])
    assert (record["times_weighed"], record["times_weighed_free"]) == (2, 1)
    assert record["table_friction"]["value"] == pytest.approx(1.0 / 2.94)
    measured = read_measured(tmp_path)
    assert measured.mass_kg.value == pytest.approx(0.2998, abs=1e-4)
    assert measured.centre_m == pytest.approx([0.02, -0.01])
    assert measured.table_friction.value == pytest.approx(1.0 / 2.94)


def test_a_weighed_shape_has_its_inertia(tmp_path):
    cube = trimesh.creation.box([0.06] * 3)
    shape = SurfaceMesh(cube.vertices, cube.faces, np.full(8, 0.001), cube.vertex_normals, is_closed=True)
    found = ObjectProperties(hangings=[(1, FREE)])
    write_properties(tmp_path, found, POSES, shape)
    measured = read_measured(tmp_path)
    even = measured.mass_kg.value * 0.06**2 / 6
    off_m2 = np.array([0.0, 0.0, 0.02**2 + 0.01**2])
    assert measured.centre_sigma_m == pytest.approx(0.001)
    assert measured.inertia.moments_kg_m2[2] == pytest.approx(even + measured.mass_kg.value * off_m2[2])
    assert np.all(measured.inertia.moments_sigma_kg_m2 > 0)
    write_properties(tmp_path, found, POSES)
    assert read_measured(tmp_path).inertia is None


def test_an_object_that_was_not_weighed_has_no_file_and_no_mass(tmp_path):
    write_properties(tmp_path, ObjectProperties(sliding=[(0, np.ones(50))]), POSES)
    assert not (tmp_path / PROPERTIES).exists()
    assert read_measured(tmp_path).mass_kg is None


def test_one_that_never_hung_free_has_a_file_without_a_mass(tmp_path):
    write_properties(tmp_path, ObjectProperties(hangings=[(1, STANDING)]), POSES)
    assert read_measured(tmp_path).mass_kg is None


def test_a_damaged_file_is_named(tmp_path):
    (tmp_path / PROPERTIES).write_text('{"mass_kg": {"value": "heavy"}}')
    with pytest.raises(SessionError, match="need finite values"):
        read_measured(tmp_path)
