"""A session out of the simulated rig, and in every form for others."""

from __future__ import annotations

import csv
import json

import h5py
import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory
from rosbags.highlevel import AnyReader

from drivers.core.errors import ConfigurationError
from sessions.exchange.archives import import_archive
from sessions.exchange.extracting import Piece, extract
from sessions.recording.session import Session
from sessions.recording.traffic.reader import TrafficReader
from tactile_lab.workflow import exporting
from tactile_lab.workflow.replaying import recorded_seed, recorded_slam


@pytest.fixture(scope="module")
def session(recorded):
    return Session.open(recorded)


@pytest.fixture(scope="module")
def first_grasp(session, tmp_path_factory):
    """The session up to its first picture."""
    folder = tmp_path_factory.mktemp("piece") / "first-grasp"
    extract(session, folder, Piece(to_s=9.0))
    return Session.open(folder)


def test_a_standard_reader_lists_topics_schemas_and_the_calibration(session):
    with (session.folder / "traffic.mcap").open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        named = {c.topic: summary.schemas[c.schema_id].name for c in summary.channels.values() if c.schema_id}
        attached = {item.name for item in reader.iter_attachments()}
    assert {
        "/link/hand/rx": "tactile_lab/msg/RawFrame",
        "/ft/FF/wrench": "tactile_lab.Wrench",
        "/hand/joints": "foxglove.JointStates",
        "/tf": "foxglove.FrameTransforms",
        "/contacts/points": "foxglove.PointCloud",
        "/contacts/scene": "foxglove.SceneUpdate",
        "/camera/image": "foxglove.CompressedImage",
        "/camera/calibration": "foxglove.CameraCalibration",
        "/slam/pose": "foxglove.PoseInFrame",
        "/recorder/streams": "tactile_lab.Streams",
    }.items() <= named.items()
    assert {"session.yaml", "calibration/joints.yaml", "calibration/camera.yaml"} <= attached


def test_devices_number_their_messages_in_the_recording(session):
    counters = [m.device.counter for m in session.traffic().messages() if m.topic == "/link/ft/FF/rx"]
    assert counters == list(range(counters[0], counters[0] + len(counters)))
    assert session.manifest.data_loss == {}


def test_tables_say_the_same_in_every_form(first_grasp, tmp_path):
    rows = exporting.export_csv(first_grasp, tmp_path / "csv")
    assert rows == exporting.export_hdf5(first_grasp, tmp_path / "s.h5")
    assert rows < exporting.export_rosbag(first_grasp, tmp_path / "bag")  # and its frames and markers
    with (tmp_path / "csv" / "wrench_FF.csv").open(newline="") as file:
        lines = list(csv.DictReader(file))
    with h5py.File(tmp_path / "s.h5") as file:
        assert file["wrench_FF/fx_N"][:].tolist() == [float(line["fx_N"]) for line in lines]
        assert file["joints/FFJ1_rad"].shape == file["joints/stamp_ns"].shape
        assert len(file["pictures/encoded"]) == len(list((tmp_path / "csv" / "pictures").iterdir())) > 0
    with AnyReader([tmp_path / "bag"]) as bag:
        kinds = {connection.topic: connection.msgtype for connection in bag.connections}
        wrenches = [c for c in bag.connections if c.topic == "/ft/FF/wrench"]
        forces = [bag.deserialize(raw, c.msgtype).wrench.force.x for c, _, raw in bag.messages(wrenches)]
    assert kinds["/joint_states"] == "sensor_msgs/msg/JointState"
    assert kinds["/camera/image/compressed"] == "sensor_msgs/msg/CompressedImage"
    assert np.array_equal(forces, [float(line["fx_N"]) for line in lines])
    for export, place in (
        (exporting.export_csv, "csv"),
        (exporting.export_hdf5, "s.h5"),
        (exporting.export_rosbag, "bag"),
    ):
        with pytest.raises(ConfigurationError, match="exists already"):
            export(first_grasp, tmp_path / place)


def test_a_whole_session_is_told_to_viewers_in_standard_types_with_every_frame_connected(session, tmp_path):
    count = exporting.export_foxglove(session, tmp_path / "s.mcap")
    parents, used, told = {}, set(), {}
    with (tmp_path / "s.mcap").open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        summary = reader.get_summary()
        assert summary.statistics.message_count == count
        topics = [one.topic for one in summary.channels.values() if one.message_encoding == "protobuf"]
        for _, channel, _, message in reader.iter_decoded_messages(topics=topics):
            told[channel.topic] = message
            for one in getattr(message, "transforms", ()):
                parents[one.child_frame_id] = one.parent_frame_id
            used |= {one.frame_id for one in [message, *getattr(message, "entities", ())] if hasattr(one, "frame_id")}
    assert {"camera", "object", "rh_ffdistal", "world"} <= used
    for frame in used:
        while frame != "world":
            frame = parents[frame]
    estimates = [json.loads(m.data) for m in session.traffic().messages() if m.topic == "/slam/pose"]
    assert told["/object/pose"].pose.position.x == estimates[-1]["pose"]["position"]["x"]
    assert told["/object/surface"].entities[0].triangles[0].indices
    size = sum(path.stat().st_size for path in session.folder.glob("traffic*.mcap"))
    assert (tmp_path / "s.mcap").stat().st_size < 0.3 * size


def test_a_session_out_of_an_archive_is_the_same_in_every_byte_that_a_replay_reads(session, tmp_path):
    exporting.export_archive(session, tmp_path / "a.zip")
    copy = import_archive(tmp_path / "a.zip", tmp_path / "in", "copy-1")
    read = ("traffic.mcap", "calibration/*", "truth/*", "results/*.csv", "results/*.ply")
    files = [path.relative_to(session.folder) for form in read for path in session.folder.glob(form)]
    assert len(files) > 8
    for path in files:
        assert (copy.folder / path).read_bytes() == (session.folder / path).read_bytes(), path
    assert (recorded_slam(copy), recorded_seed(copy)) == (recorded_slam(session), recorded_seed(session))


def test_a_piece_of_a_session_is_a_session(session, tmp_path):
    counts = extract(session, tmp_path / "piece-1", Piece(3.0, 3.5, {"hand", "ft/FF"}))
    assert {topic for topic in counts if topic.startswith("/link")} == {
        "/link/hand/tx", "/link/hand/rx", "/link/ft/FF/rx",
    }  # fmt: skip
    piece = Session.open(tmp_path / "piece-1")
    assert piece.calibration_file("joints").is_file()
    assert sum(1 for _ in piece.traffic().messages()) == sum(counts.values())
    with pytest.raises(ConfigurationError, match=r"no transport called elbow.*Its transports are base, camera, ft/FF"):
        extract(session, tmp_path / "piece-2", Piece(transports={"elbow"}))
    with pytest.raises(ConfigurationError, match="nothing was recorded in that part"):
        extract(session, tmp_path / "piece-2", Piece(from_s=1e6))
    with pytest.raises(ConfigurationError, match="exists already"):
        extract(session, tmp_path / "piece-1", Piece())
    with pytest.raises(ConfigurationError, match="cannot be the name"):
        extract(session, tmp_path / "Piece", Piece())
    assert not (tmp_path / "piece-2").exists()


def test_the_record_at_the_end_says_what_was_lost(session):
    reader = TrafficReader(session.folder / "traffic.mcap")
    messages = sum(1 for message in reader.messages() if message.topic == "/link/hand/rx")
    assert reader.streams()["/link/hand/rx"] == {"messages": messages, "gaps": 0, "late": 0, "dropped": 0}
    assert json.loads(reader.end["lost"]) == {}
    assert reader.end["status"] == "closed"
