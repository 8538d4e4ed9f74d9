"""Whatever a log can hold is read back as it was written, to the last bit; nonsense in it is named."""

from __future__ import annotations

import contextlib
import copy
import json
from pathlib import Path

import numpy as np
import pytest
from gtsam import Pose3, Rot3
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.core.contacts import ApproachPath, Contact, Grasp, StepSigma
from drivers.core.errors import ConfigurationError
from sessions.exchange.contact_log import ContactLog, MotionSigma, ObjectTruth, read_contact_log, write_contact_log
from tactile_lab.experiments.data.planar_data import simulate
from tactile_lab.slam.slam_settings import SlamSettings
from tactile_lab.slam.tactile_slam import TactileSlam
from tests.support.repository import REPOSITORY

coordinates = st.floats(-0.25, 0.25)
points = st.tuples(coordinates, coordinates, coordinates).map(np.array)
angles = st.floats(-3.0, 3.0)
poses = st.builds(lambda turn, point: Pose3(Rot3.Ypr(*turn), point), st.tuples(angles, angles, angles), points)
sigmas = st.floats(1e-5, 0.1)
covariances = st.builds(
    lambda roots: (lambda root: (root @ root.T + (root @ root.T).T) / 2)(np.array(roots).reshape(3, 3)),
    st.lists(st.floats(-0.01, 0.01), min_size=9, max_size=9),
) | sigmas.map(lambda sigma: sigma**2 * np.eye(3))


@st.composite
def directions(draw):
    yaw, pitch = draw(angles), draw(st.floats(-1.5, 1.5))
    vector = np.array([np.cos(yaw) * np.cos(pitch), np.sin(yaw) * np.cos(pitch), np.sin(pitch)])
    return vector / np.linalg.norm(vector)


fingers = st.sampled_from(["FF", "MF", "RF", "LF", "TH", "tip of the gripper"])
contacts = st.builds(Contact, fingers, points, directions(), covariances, sigmas, st.floats(0.0, 9.0))
lines = st.builds(ApproachPath, fingers, points, points, st.booleans())


@st.composite
def logs(draw):
    count = draw(st.integers(1, 4))
    grasps = tuple(
        Grasp(
            index,
            draw(st.integers(0, 2**50)),
            tuple(draw(st.lists(contacts, min_size=0 if index else 1, max_size=5))),
            draw(poses),
            draw(poses),
            tuple(draw(st.lists(lines, max_size=5))),
            draw(st.none() | st.builds(StepSigma, sigmas, sigmas)),
        )
        for index in range(count)
    )
    truth = draw(
        st.none()
        | st.builds(ObjectTruth, name=st.text(max_size=5), mesh=st.none() | st.just("a.ply"))
        | st.just(ObjectTruth(polygon_m=((0.0, 0.0), (0.1, 0.0), (0.1, 1 / 30))))
    )
    motion = draw(
        st.none() | st.builds(MotionSigma, translation_m=sigmas, rotation_rad=sigmas, unheld=st.floats(0.01, 1.0))
    )
    return ContactLog(3, draw(sigmas), draw(sigmas), motion, grasps, truth, tuple(draw(poses) for _ in range(count)))


def same(one: ContactLog, other: ContactLog) -> None:
    assert (one.dimension, one.point_sigma_m, one.normal_sigma_rad) == (
        other.dimension,
        other.point_sigma_m,
        other.normal_sigma_rad,
    )
    assert (one.motion_sigma, one.truth) == (other.motion_sigma, other.truth)
    assert [pose.matrix().tolist() for pose in one.true_poses] == [pose.matrix().tolist() for pose in other.true_poses]
    assert list(map(content, one.grasps)) == list(map(content, other.grasps))


def content(grasp: Grasp):
    """Everything in a grasp, as numbers."""
    touches = [
        (c.finger, *(v.tolist() for v in (c.point_world_m, c.normal_world, c.point_covariance_m2)), c.normal_sigma_rad)
        for c in grasp.contacts
    ]
    forces = [contact.force_N for contact in grasp.contacts]
    ways = [(x.finger, x.start_world_m.tolist(), x.end_world_m.tolist(), x.touched) for x in grasp.approach_paths]
    matrices = (grasp.world_T_palm.matrix().tolist(), grasp.hand_motion_world.matrix().tolist())
    return grasp.index, grasp.stamp_ns, touches, forces, ways, matrices, grasp.motion_sigma


class InwardNormalsError(Exception):
    """Random normals may well point into the object, which is refused."""


def read(path: Path) -> ContactLog:
    try:
        return read_contact_log(path)
    except ConfigurationError as error:
        if "point into the object" not in str(error):
            raise
        raise InwardNormalsError from error


@settings(max_examples=60, deadline=None, derandomize=True)
@given(log=logs())
def test_a_log_is_read_back_to_the_last_bit(tmp_path_factory, log):
    path = tmp_path_factory.getbasetemp() / "round_trip.json"
    with contextlib.suppress(InwardNormalsError):
        write_contact_log(path, log)
        same(log, read(path))


def planar_log(shape: str = "rectangle", **changes) -> ContactLog:
    data = simulate(shape, 3, count=6)
    truth = ObjectTruth(name=shape, polygon_m=tuple(map(tuple, data.outline_m.tolist())))
    motion = MotionSigma(translation_m=0.01, rotation_rad=0.349)
    content = {"dimension": 2, "point_sigma_m": 0.001, "normal_sigma_rad": 0.0873, "motion_sigma": motion}
    return ContactLog(**{**content, "grasps": data.grasps, "truth": truth, "true_poses": data.world_T_body, **changes})


def test_the_estimation_is_the_same_from_a_written_planar_log(tmp_path: Path):
    log = planar_log()
    write_contact_log(tmp_path / "log.json", log)
    found = read_contact_log(tmp_path / "log.json")
    ends = []
    for grasps in (log.grasps, found.grasps):
        slam = TactileSlam(SlamSettings(method="particle", particles=500, back_end={"enabled": False}))
        for grasp in grasps:
            slam.add_grasp(grasp)
        ends.append(slam.world_T_object.matrix())
    np.testing.assert_allclose(*ends, atol=1e-6)


def test_only_what_differs_from_the_log_s_own_sigmas_is_written(tmp_path: Path):
    log = planar_log(normal_sigma_rad=float(np.deg2rad(5.0)))
    write_contact_log(tmp_path / "log.json", log)
    document = json.loads((tmp_path / "log.json").read_text())
    assert set(document["grasps"][0]["contacts"][0]) == {"finger", "point_world_m", "normal_world", "force_N"}
    assert len(document["grasps"][0]["closing_lines"]) >= 4


@pytest.fixture(scope="module")
def document(tmp_path_factory) -> dict:
    path = tmp_path_factory.mktemp("log") / "log.json"
    write_contact_log(path, planar_log())
    return json.loads(path.read_text())


def read_changed(folder: Path, document: dict, change) -> ContactLog:
    changed = copy.deepcopy(document)
    change(changed)
    (folder / "log.json").write_text(json.dumps(changed))
    return read_contact_log(folder / "log.json")


def test_a_contact_s_own_sigma_goes_before_the_log_s(tmp_path: Path, document: dict):
    def change(log):
        log["grasps"][1]["contacts"][0] |= {"point_sigma_m": 0.003, "normal_sigma_rad": 0.2}

    first, second = read_changed(tmp_path, document, change).grasps[1].contacts[:2]
    np.testing.assert_allclose(first.point_covariance_m2, 9e-6 * np.eye(3))
    np.testing.assert_allclose(second.point_covariance_m2, 1e-6 * np.eye(3))
    assert first.normal_sigma_rad == 0.2


def test_a_log_need_not_know_how_far_the_object_strays(tmp_path: Path, document: dict):
    assert read_changed(tmp_path, document, lambda log: log.pop("motion_sigma")).motion_sigma is None


def scaled(log: dict, factor: float) -> None:
    for grasp in log["grasps"]:
        for contact in grasp["contacts"]:
            contact["point_world_m"] = [factor * x for x in contact["point_world_m"]]


def negated(log: dict) -> None:
    for grasp in log["grasps"]:
        for contact in grasp["contacts"]:
            contact["normal_world"] = [-x for x in contact["normal_world"]]


def far(log: dict) -> None:
    log["grasps"][2]["hand_motion_world"][0][3] += 10.0


def wide(log: dict) -> None:
    log["object"]["polygon_m"] = [[1000 * x, 1000 * y] for x, y in log["object"]["polygon_m"]]


def lonely(log: dict) -> None:
    for index, grasp in enumerate(log["grasps"]):
        grasp["contacts"] = grasp["contacts"][:1]
        grasp["contacts"][0]["point_world_m"] = [50.0 * index, 30.0, 0.0]
    log["grasps"][0]["hand_motion_world"] = np.eye(4).tolist()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda log: scaled(log, 1000.0), "m apart; are .*lengths in millimetres"),
        (lonely, "the grasps are .* m apart; are .*lengths in millimetres"),
        (far, "the hand moved by .* before grasp 2; are .*lengths in millimetres"),
        (wide, "polygon is 100 m wide; are .*lengths in millimetres"),
        (lambda log: log.update(point_sigma_m=1.0), "point_sigma_m: 1 is too large; is it in millimetres"),
        (lambda log: log.update(normal_sigma_rad=5.0), "normal_sigma_rad: 5 is too large; is it in degrees"),
        (lambda log: log["motion_sigma"].update(rotation_rad=20.0), "20 is too large; is it in degrees"),
        (lambda log: log["motion_sigma"].update(translation_m=10.0), "10 is too large; is it in millimetres"),
        (negated, "normals point into the object, in .* pairs of opposing contacts. .* negate them"),
        (lambda log: log["grasps"][0]["contacts"][0].update(finger=""), "finger"),
        (lambda log: log["grasps"][0]["contacts"][0].update(force_N=-1.0), "force_N"),
        (lambda log: log["grasps"][0]["closing_lines"][0].pop("touched"), "touched: is missing"),
        (lambda log: log["grasps"][0]["closing_lines"][0].update(end_world_m=[0, 0, 0.1]), "z = 0"),
        (
            lambda log: log["grasps"][0]["contacts"][0].update(point_covariance_m2=(-np.eye(3)).tolist()),
            "not a covariance",
        ),
        (lambda log: log.update(point_sigma=0.001), r"point_sigma: unknown key \(did you mean point_sigma_m"),
    ],
)
def test_nonsense_is_named(tmp_path: Path, document: dict, change, message: str):
    with pytest.raises(ConfigurationError, match=message):
        read_changed(tmp_path, document, change)


@pytest.mark.parametrize("shape", ["rectangle", "triangle", "ellipse", "L", "hexagon", "stadium"])
@pytest.mark.parametrize("outliers", [0.0, 0.1])
def test_outward_normals_of_no_shape_are_taken_for_inward_ones(tmp_path: Path, shape: str, outliers: float):
    grasps = simulate(shape, 1, count=10, outlier_share=outliers).grasps
    write_contact_log(tmp_path / "log.json", planar_log(grasps=grasps, true_poses=()))
    assert len(read_contact_log(tmp_path / "log.json").grasps) == 10


def test_the_example_in_the_guide_is_a_log(tmp_path: Path):
    guide = (REPOSITORY / "docs" / "contact-log.md").read_text()
    (tmp_path / "log.json").write_text(guide.split("```json\n")[1].split("```")[0])
    log = read_contact_log(tmp_path / "log.json")
    assert log.truth.name == "box"
    assert log.grasps[0].approach_paths[0].touched
