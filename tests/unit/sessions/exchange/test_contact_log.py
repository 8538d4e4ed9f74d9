from __future__ import annotations

import contextlib
import copy
import json
from dataclasses import replace

import numpy as np
import pytest
from gtsam import Pose3, Rot3
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.core.contacts import Contact, Grasp
from drivers.core.errors import ConfigurationError
from sessions.exchange.contact_log import ContactLog, MotionSigma, ObjectTruth, read_contact_log, write_contact_log

IDENTITY = np.eye(4).tolist()
DOCUMENT = {
    "format": "tactile-contacts/1",
    "dimension": 2,
    "point_sigma_m": 0.001,
    "normal_sigma_rad": 0.0873,
    "motion_sigma": {"translation_m": 0.01, "rotation_rad": 0.349},
    "object": {"name": "box", "polygon_m": [[0.05, 0.03], [-0.05, 0.03], [-0.05, -0.03], [0.05, -0.03]]},
    "grasps": [
        {
            "stamp_s": 1.5,
            "contacts": [
                {"finger": "FF", "point_world_m": [0.01, 0.03, 0.0], "normal_world": [0.0, 1.0, 0.0]},
                {"finger": "TH", "point_world_m": [0.01, -0.03, 0.0], "normal_world": [0.0, -1.0, 0.0]},
            ],
            "hand_motion_world": IDENTITY,
            "world_T_object": IDENTITY,
        },
        {"stamp_s": 2.0, "contacts": [], "hand_motion_world": IDENTITY},
    ],
}


def changed(path, value):
    document = copy.deepcopy(DOCUMENT)
    place = document
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = value
    return document


def save(folder, document):
    path = folder / "log.json"
    path.write_text(json.dumps(document))
    return path


def contact(finger, point, normal):
    normal = np.array(normal) / np.linalg.norm(normal)
    return Contact(finger, np.array(point), normal, 1e-6 * np.eye(3), 0.1, 0.0)


def log(dimension, grasps, **options):
    return ContactLog(
        dimension, 0.001, 0.1, MotionSigma(translation_m=0.01, rotation_rad=0.3), tuple(grasps), **options
    )


def test_a_log_is_read_into_grasps_with_truth_apart(tmp_path):
    found = read_contact_log(save(tmp_path, DOCUMENT))
    assert found.dimension == 2
    assert found.motion_sigma.rotation_rad == 0.349
    assert [contact.finger for contact in found.grasps[0].contacts] == ["FF", "TH"]
    assert found.grasps[0].stamp_ns == 1_500_000_000
    np.testing.assert_allclose(found.grasps[0].contacts[0].point_covariance_m2, 1e-6 * np.eye(3))
    np.testing.assert_allclose(found.grasps[0].world_T_palm.translation(), [0.01, 0.0, 0.0], atol=1e-15)
    assert found.truth.name == "box"
    assert found.true_poses[0].equals(Pose3(), 0.0)
    assert found.true_poses[1] is None


def test_what_is_written_is_read_back(tmp_path):
    motion = Pose3(Rot3.Ypr(0.3, 0.1, 0.0), np.array([0.01, 0.02, 0.001]))
    grasps = [
        Grasp(0, 0, (contact("FF", [0.01, 0.02, 0.03], [1, 2, 3]),), Pose3()),
        Grasp(1, 1_234_567_891, (contact("TH", [0.0, 0.0, 0.01], [0, 0, 1]),), Pose3(), motion),
    ]
    written = log(3, grasps, truth=ObjectTruth(name="m", mesh="m.ply"), true_poses=(motion, None))
    write_contact_log(tmp_path / "log.json", written)
    found = read_contact_log(tmp_path / "log.json")
    assert [grasp.stamp_ns for grasp in found.grasps] == [0, 1_234_567_891]
    for one, other in zip(written.grasps, found.grasps, strict=True):
        np.testing.assert_array_equal(one.points_world_m, other.points_world_m)
        np.testing.assert_allclose(one.normals_world, other.normals_world, atol=1e-15)
        assert one.hand_motion_world.equals(other.hand_motion_world, 1e-15)
    assert found.truth == written.truth
    assert found.true_poses[0].equals(motion, 1e-15)


def test_what_the_contacts_of_a_finger_share_is_read_back(tmp_path):
    shared = np.diag([4e-7, 1e-7, 2e-7])
    touches = (
        replace(contact("FF", [0.01, 0.02, 0.03], [1, 0, 0]), shared_covariance_m2=shared, shared_by_all=True),
        contact("TH", [0.0, 0.02, 0.03], [-1, 0, 0]),
    )
    for dimension, expected in ((3, shared), (2, np.diag([4e-7, 1e-7, 0.0]))):
        write_contact_log(tmp_path / f"{dimension}.json", log(dimension, [Grasp(0, 0, touches, Pose3())]))
        first, second = read_contact_log(tmp_path / f"{dimension}.json").grasps[0].contacts
        np.testing.assert_array_equal(first.shared_covariance_m2, expected)
        assert second.shared_covariance_m2 is None
        assert (first.shared_by_all, second.shared_by_all) == (True, False)


def test_how_each_error_of_a_finger_moves_a_contact_is_read_back(tmp_path):
    moves = np.array([[4e-4, 1e-4], [2e-4, 0.0], [-1e-4, 3e-4]])
    stating = replace(contact("FF", [0.01, 0.02, 0.03], [1, 0, 0]), shared_moves_m=moves)
    for dimension, expected in ((3, moves), (2, moves * [[1], [1], [0]])):
        path = tmp_path / f"{dimension}.json"
        write_contact_log(path, log(dimension, [Grasp(0, 0, (stating,), Pose3())]))
        (found,) = read_contact_log(path).grasps[0].contacts
        np.testing.assert_array_equal(found.shared_moves_m, expected)
        assert found.shared_covariance_m2 is None


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ({"shared_moves_m": [[1e-4], [0.0], [0.0, 0.0]]}, "same length"),
        ({"shared_moves_m": [[], [], []]}, "at least 1"),
        ({"shared_moves_m": [[1e-4], [0], [0]], "shared_covariance_m2": np.zeros((3, 3)).tolist()}, "give one of them"),
        ({"shared_moves_m": [[2e-3], [0], [0]], "point_covariance_m2": (1e-6 * np.eye(3)).tolist()}, "farther than"),
    ],
)
def test_moves_that_do_not_fit_are_refused(tmp_path, entry, message):
    path = tmp_path / "log.json"
    write_contact_log(path, log(3, [Grasp(0, 0, (contact("FF", [0.01, 0.02, 0.03], [1, 0, 0]),), Pose3())]))
    document = json.loads(path.read_text())
    document["grasps"][0]["contacts"][0].update(entry)
    path.write_text(json.dumps(document))
    with pytest.raises(ConfigurationError, match=message):
        read_contact_log(path)


def test_a_planar_log_keeps_the_horizontal_part(tmp_path):
    tilted = Pose3(Rot3.Ypr(0.3, 0.05, 0.02), np.array([0.01, 0.02, 0.004]))
    touches = (contact("FF", [0.01, 0.02, 0.03], [3, 4, 1]), contact("MF", [0.0, 0.0, 0.05], [0.1, 0, 1]))
    write_contact_log(tmp_path / "log.json", log(2, [Grasp(0, 0, touches, Pose3(), tilted)]))
    (found,) = read_contact_log(tmp_path / "log.json").grasps
    np.testing.assert_array_equal(found.points_world_m, [[0.01, 0.02, 0.0]])
    np.testing.assert_allclose(found.normals_world, [[0.6, 0.8, 0.0]])
    assert found.hand_motion_world.z() == 0.0
    np.testing.assert_allclose(found.hand_motion_world.rotation().matrix()[2], [0.0, 0.0, 1.0])


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        (["format"], "tactile-contacts/2", "its format is 'tactile-contacts/2'"),
        (["dimension"], 4, "dimension"),
        (["point_sigma_m"], 0.0, "point_sigma_m"),
        (["point_sigma_m"], float("nan"), "point_sigma_m"),
        (["grasps"], [], "grasps"),
        (["grasps", 0, "contacts"], [], "no grasp has a contact"),
        (["grasps", 0, "contacts", 0, "point_world_m"], [10.0, 30.0, 0.0], "millimetres"),
        (["grasps", 0, "contacts", 0, "point_world_m"], [0.01, float("nan"), 0.0], r"contacts\.0\.point_world_m\.1"),
        (["grasps", 0, "contacts", 0, "point_world_m"], [0.01, 0.0], r"contacts\.0\.point_world_m"),
        (["grasps", 0, "contacts", 0, "point_world_m"], [0.01, 0.0, 0.02], "z = 0"),
        (["grasps", 0, "contacts", 0, "normal_world"], [0.0, 2.0, 0.0], "a normal must have length 1, not 2"),
        (["grasps", 0, "hand_motion_world"], (2 * np.eye(4)).tolist(), "not a rigid motion"),
        (["grasps", 0, "hand_motion_world"], np.diag([1.0, 1.0, -1.0, 1.0]).tolist(), "not a rigid motion"),
        (["grasps", 0, "hand_motion"], IDENTITY, "hand_motion"),
        (["object", "polygon_m"], [[0, 0], [1, 1]], "polygon_m"),
        (["object", "polygon_m"], [[0.0, 0.001 * k] for k in range(2001)], "polygon_m"),
        (
            ["object"],
            {"mesh": "../secret.ply"},
            "is not the name of a file in the log's own folder",
        ),
        (["grasps"], [{}] * 10_001, "grasps: 10001 are more than the 10000"),
        (["grasps", 0, "contacts"], [{}] * 101, r"grasps\.0\.contacts: 101 are more than 100"),
        (["object"], {"mesh": "/etc/truth.ply"}, "log's own folder"),
        (["object"], {"mesh": ".."}, "log's own folder"),
        (["grasps", 0, "contacts", 0, "point_world_m"], [1e6, 0.0, 0.0], "millimetres"),
        (["grasps", 0, "world_T_object"], [[1, 0, 0, 1e6], *IDENTITY[1:]], "move the world's origin"),
        (["grasps", 0, "hand_motion_world"], [[1, 0, 0, 1e6], *IDENTITY[1:]], "move the world's origin"),
    ],
)
def test_bad_logs_are_explained(tmp_path, path, value, message):
    with pytest.raises(ConfigurationError, match=message) as caught:
        read_contact_log(save(tmp_path, changed(path, value)))
    assert "log.json" in str(caught.value)


@pytest.mark.parametrize("content", ["", "{", "[" * 100_000, '{"format": 1, "format": 2}', "\x00"])
def test_files_that_are_no_json_are_named(tmp_path, content):
    (tmp_path / "log.json").write_text(content)
    with pytest.raises(ConfigurationError, match=r"log\.json: is not JSON"):
        read_contact_log(tmp_path / "log.json")


def test_a_missing_log_and_other_json_are_named(tmp_path):
    with pytest.raises(ConfigurationError, match="cannot be read"):
        read_contact_log(tmp_path / "none.json")
    with pytest.raises(ConfigurationError, match="its format is None"):
        read_contact_log(save(tmp_path, [1, 2]))


def test_an_empty_log_is_not_written(tmp_path):
    with pytest.raises(ConfigurationError, match="no grasp has a contact"):
        write_contact_log(tmp_path / "log.json", log(3, [Grasp(0, 0, (), Pose3())]))
    assert not (tmp_path / "log.json").exists()


json_values = st.recursive(
    st.none() | st.booleans() | st.floats() | st.text(max_size=3),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=3), inner, max_size=3),
    max_leaves=6,
)
PATHS = [["dimension"], ["motion_sigma"], ["object"], ["grasps"], ["grasps", 0], ["grasps", 0, "contacts", 0]]


@settings(max_examples=80, deadline=None, derandomize=True)
@given(path=st.sampled_from(PATHS), value=json_values)
def test_whatever_stands_in_a_log_is_read_or_explained(tmp_path_factory, path, value):
    file = save(tmp_path_factory.getbasetemp(), changed(path, value))
    with contextlib.suppress(ConfigurationError):
        read_contact_log(file)
