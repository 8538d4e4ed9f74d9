"""The same session in Foxglove's, Rerun's and ROS's types, decoded by packages that are not ours."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from drivers.core.errors import ConfigurationError, SessionError
from sessions.exchange.sample_tables import SampleTables
from tactile_lab.viewers import cdr
from tactile_lab.viewers.foxglove_file import write_foxglove
from tactile_lab.viewers.items import Item, Surface
from tactile_lab.viewers.rerun_file import show_in_rerun, write_rerun
from tactile_lab.viewers.robot import CAMERA, OBJECT, WORLD, Robot
from tactile_lab.viewers.ros_bag import write_ros_bag
from tests.support import told_session
from tests.support.repository import REPOSITORY

STORE = get_typestore(Stores.ROS2_JAZZY)
RERUN = Path(sys.executable).with_name("rerun")


class ToldItems:
    """Stands for a session's items."""

    def __init__(self) -> None:
        self.robot: Robot = told_session.robot()

    def __iter__(self) -> Iterator[Item]:
        return iter(told_session.items(self.robot))


@pytest.fixture(scope="module")
def decoded(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[Any]]:
    """Messages by topic, from Foxglove's file."""
    path = tmp_path_factory.mktemp("foxglove") / "told.mcap"
    count = write_foxglove(path, ToldItems(), {"session": "told"})
    found: dict[str, list[Any]] = {}
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        summary = reader.get_summary()
        assert summary.statistics.message_count == count
        assert [one.name for one in reader.iter_attachments()] == ["robot.urdf"]
        topics = [one.topic for one in summary.channels.values() if one.message_encoding == "protobuf"]
        for schema, channel, _, message in reader.iter_decoded_messages(topics=topics):
            assert schema.name.startswith("foxglove.")
            found.setdefault(channel.topic, []).append(message)
        for _, channel, message in reader.iter_messages(topics=["/ft/FF/wrench", "/robot_description"]):
            kind = {"/ft/FF/wrench": "geometry_msgs/msg/WrenchStamped"}.get(channel.topic, "std_msgs/msg/String")
            found.setdefault(channel.topic, []).append(STORE.deserialize_cdr(message.data, kind))
    return found


def test_every_kind_of_item_is_decoded_by_foxglove_s_own_package(decoded):
    assert set(decoded) == {
        "/camera/calibration", "/camera/image", "/candidates", "/contacts/forces", "/contacts/points",
        "/contacts/scene", "/ft/FF/wrench", "/joint_states", "/loads", "/log", "/object/odometry", "/object/points",
        "/object/pose",
        "/object/surface", "/robot/scene", "/robot_description", "/tf", "/tf_static", "/truth/object",
    }  # fmt: skip


def test_the_layout_shows_topics_that_there_are(decoded):
    layout = json.loads((REPOSITORY / "docs" / "examples" / "foxglove-layout.json").read_text())
    panels = layout["configById"]
    shown = set(panels["3D!hand"]["topics"]) | set(panels["Image!camera"]["imageMode"].values())
    shown |= {panels["RosOut!log"]["topicToRender"]}
    shown |= {one["value"].partition(".")[0] for one in panels["Plot!forces"]["paths"] if "/FF/" in one["value"]}
    assert shown <= set(decoded)
    assert json.dumps(layout["layout"]).count("!") == len(panels)  # every panel has its place


def test_the_page_of_the_open_viewer_finds_its_layout():
    examples = REPOSITORY / "docs" / "examples"
    page = (examples / "open-viewer.html").read_text()
    (fetched,) = re.findall(r'fetch\("([^"]+)"\)', page)
    panels = json.loads((examples / fetched).read_text())["configById"]
    (panel,) = re.findall(r'layout\.configById\["([^"]+)"\]', page)
    assert panels[panel]["imageMode"]["imageTopic"] == "/camera/image"


def test_frames_form_one_tree_below_the_world(decoded):
    told = [one for topic in ("/tf", "/tf_static") for message in decoded[topic] for one in message.transforms]
    parents = {one.child_frame_id: one.parent_frame_id for one in told}
    used = {entity.frame_id for message in decoded["/robot/scene"] for entity in message.entities} | {OBJECT}
    assert_connected(used, parents)


def assert_connected(used: set[str], parents: dict[str, str]) -> None:
    """Every frame leads to the world."""
    for frame in used:
        steps = 0
        while frame != WORLD:
            assert frame in parents, f"{frame} has no parent"
            frame, steps = parents[frame], steps + 1
            assert steps < 40


def test_joints_have_the_names_and_angles_of_the_hand(decoded):
    joints, base = told_session.posture()
    positions = {one.name: one.position for one in decoded["/joint_states"][0].joints}
    assert positions == told_session.robot().positions(joints, base)
    assert len(positions) == 30


def test_the_surface_is_a_mesh_coloured_by_its_uncertainty(decoded):
    (entity,) = decoded["/object/surface"][0].entities
    (mesh,) = entity.triangles
    assert (entity.frame_id, len(mesh.points), list(mesh.indices)) == (OBJECT, 4, np.ravel(told_session.FACES).tolist())
    brightness = [colour.r + colour.g for colour in mesh.colors]
    assert brightness[0] < brightness[1] < brightness[2] == brightness[3]  # all is unknown from 10 mm on


def test_contacts_have_arrows_forces_and_uncertainties_and_an_undone_grasp_goes(decoded):
    first, _, again = decoded["/contacts/scene"]
    (entity,) = first.entities
    assert (len(entity.arrows), len(entity.spheres), len(first.deletions)) == (3, 3, 0)
    sizes = sorted(np.round([entity.spheres[0].size.x, entity.spheres[0].size.y, entity.spheres[0].size.z], 9))
    assert sizes == pytest.approx([0.004, 0.008, 0.012])  # twice two standard deviations of 1, 2 and 3 mm
    assert [one.id for one in again.deletions] == ["grasp-1"]
    forces = decoded["/contacts/forces"][0].entities[0].arrows
    lengths = [arrow.shaft_length + arrow.head_length for arrow in forces]
    assert lengths == pytest.approx([0.0125, 0.025, 0.0375])  # 0.5, 1 and 1.5 N


def test_the_pose_is_told_with_its_covariance(decoded):
    told = decoded["/object/odometry"][0]
    assert (told.frame_id, told.body_frame_id) == (WORLD, OBJECT)
    covariance = np.reshape(told.pose_covariance, (6, 6))
    np.testing.assert_array_equal(np.diag(covariance), [1e-6, 4e-6, 0, 0, 0, 1e-4])


def test_wrench_and_description_are_ros_s(decoded):
    (wrench,) = decoded["/ft/FF/wrench"]
    assert (wrench.header.frame_id, wrench.header.stamp.sec, wrench.header.stamp.nanosec) == ("rh_ffsensor", 1, 4)
    assert (wrench.wrench.force.z, wrench.wrench.torque.z) == (3.0, 6.0)
    assert decoded["/robot_description"][0].data.startswith("<?xml")


@pytest.mark.parametrize("frame", ["", "a", "abc", "rh_ffsensor", "longer than eight"])
def test_a_wrench_is_the_same_bytes_as_rosbags_makes(frame):
    data = cdr.wrench_stamped(5_000_000_006, frame, np.arange(3.0), np.arange(3.0, 6.0))
    message = STORE.deserialize_cdr(data, "geometry_msgs/msg/WrenchStamped")
    assert bytes(STORE.serialize_cdr(message, "geometry_msgs/msg/WrenchStamped")) == data
    assert message.header.frame_id == frame


def test_a_bag_has_every_frame_connected_to_the_world(tmp_path):
    items, tables = ToldItems(), SampleTables()
    joints, base = told_session.posture()
    tables.table("joints", ["angles"]).add(told_session.STATE_ns, joints)
    tables.table("base", ["q"]).add(told_session.STATE_ns, base)
    tables.table("wrench_FF", ["w"]).add(told_session.STATE_ns, [*range(6), 1, 1, 0])
    tables.table("marks", ("kind",)).add(told_session.STATE_ns, ("tare",))
    count = write_ros_bag(tmp_path / "bag", items.robot, items, tables)
    parents, frames, kinds = {}, set(), {}
    with AnyReader([tmp_path / "bag"]) as bag:
        assert bag.message_count == count
        for connection, _, raw in bag.messages():
            message = bag.deserialize(raw, connection.msgtype)
            kinds[connection.topic] = message
            if connection.msgtype == "tf2_msgs/msg/TFMessage":
                parents |= {one.child_frame_id: one.header.frame_id for one in message.transforms}
            else:
                told = getattr(message, "markers", [message])
                frames |= {one.header.frame_id for one in told if hasattr(one, "header")}
        durable = {one.topic: one.ext.offered_qos_profiles for one in bag.connections}
    assert_connected(frames - {"", CAMERA}, parents)  # no picture shows the world marker
    assert {"/tf", "/tf_static", "/joint_states", "/camera/camera_info", "/contacts/points"} <= set(kinds)
    assert kinds["/joint_states"].name[0] in {"base_x", "rh_FFJ1"}
    assert len(kinds["/object/surface"].points) == len(kinds["/object/surface"].colors) == 12
    np.testing.assert_array_equal(kinds["/object/pose"].pose.covariance.reshape(6, 6)[:2, :2], np.diag([1e-6, 4e-6]))
    cloud = kinds["/object/points"]
    table = np.frombuffer(cloud.data.tobytes(), "<f4").reshape(cloud.width, -1)
    np.testing.assert_allclose(table[:, :3], told_session.TETRAHEDRON_m, atol=1e-7)
    assert kinds["/robot_description"].data.startswith("<?xml")
    assert "TRANSIENT_LOCAL" in str(durable["/tf_static"])


def test_rerun_opens_both_files(tmp_path):
    write_foxglove(tmp_path / "told.mcap", ToldItems(), {})
    converted = run("mcap", "convert", tmp_path / "told.mcap", "-o", tmp_path / "converted.rrd")
    assert converted.returncode == 0, converted.stderr
    assert write_rerun(tmp_path / "told.rrd", ToldItems(), "told") == len(list(ToldItems()))
    theirs, ours = (run("rrd", "print", tmp_path / name).stdout for name in ("converted.rrd", "told.rrd"))
    for path in ("/tf", "/object/points", "/object/surface", "/contacts/scene", "/joint_states", "/camera/image"):
        assert f" - {path} - " in theirs, path
    hand = "/world/mount/base_x_link/base_y_link/base_z_link/base_yaw_link/base_pitch_link/base_roll_link/rh_forearm"
    for path in (f"{hand}/rh_wrist/rh_palm/shape_0", "/world/object/surface", "/world/contacts/grasp_1/points"):
        assert f" - {path} - " in ours, path
    for path in ("/joints", "/wrench/FF/force_N", "/load_N/FF", "/world/camera/image", "/world/candidates", "/log"):
        assert f" - {path} - " in ours, path


def run(*words: object) -> subprocess.CompletedProcess[str]:
    """Rerun's own program."""
    return subprocess.run([RERUN, *map(str, words)], capture_output=True, text=True, check=False)


def test_nothing_is_left_of_a_file_that_cannot_be_completed(tmp_path):
    class Torn(ToldItems):
        def __iter__(self) -> Iterator[Item]:
            yield from list(super().__iter__())[:5]
            raise SessionError("cannot be read", where="traffic.mcap")

    for write in (
        lambda: write_foxglove(tmp_path / "a.mcap", Torn(), {}),
        lambda: write_rerun(tmp_path / "a.rrd", Torn(), "a"),
        lambda: write_ros_bag(tmp_path / "bag", Torn().robot, Torn(), SampleTables()),
    ):
        with pytest.raises(SessionError, match="cannot be read"):
            write()
    assert list(tmp_path.iterdir()) == []


def test_a_session_without_a_shape_gives_everything_else(tmp_path):
    class Shapeless(ToldItems):
        def __iter__(self) -> Iterator[Item]:
            return (one for one in super().__iter__() if not isinstance(one, Surface))

    assert write_foxglove(tmp_path / "a.mcap", Shapeless(), {}) > 20
    assert write_ros_bag(tmp_path / "bag", Shapeless().robot, Shapeless(), SampleTables()) > 10


@pytest.mark.parametrize("address", ["rerun+http://127.0.0.1:9/proxy", "rerun+http://127.0.0.1:nine/proxy"])
def test_a_rerun_viewer_that_is_not_there_is_told_before_anything_is_computed(address):
    class Untouched(ToldItems):
        def __iter__(self) -> Iterator[Item]:
            raise AssertionError("computed")

    with pytest.raises(ConfigurationError, match="its viewer cannot be reached"):
        show_in_rerun(Untouched(), "told", address)
