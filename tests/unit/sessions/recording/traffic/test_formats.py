"""Recordings and descriptions of every version open, and mean the same after being written anew."""

from __future__ import annotations

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.core.errors import SessionError
from sessions.recording.manifest import read_manifest, write_manifest
from sessions.recording.traffic import formats, raw_frames, schemas
from sessions.recording.traffic.disk import CutBackFile
from sessions.recording.traffic.files import PROFILE
from sessions.recording.traffic.mcap_writer import McapWriter
from sessions.recording.traffic.raw_frames import DeviceStamp
from sessions.recording.traffic.reader import TrafficReader
from sessions.recording.traffic.writer import TrafficWriter
from tests.support.repository import LOGS

FORMAT_1 = LOGS / "format-1.mcap"
MANIFEST_1 = {
    "format": "tactile-session/1",
    "name": "old",
    "status": "closed",
    "rig": "sim",
    "rig_description": {},
    "object_name": "box",
    "started_utc": "2026-11-21T09:30:00+00:00",
    "counts": {"grasps": 2},
}


def content(path):
    return [(m.topic, m.data, m.stamp_ns) for m in TrafficReader(path).messages()]


def test_a_recording_of_version_1_is_read_and_written_anew_without_change(tmp_path):
    reader = TrafficReader(FORMAT_1)
    assert reader.info["format"] == "tactile-traffic/1"
    old = content(FORMAT_1)
    assert len(old) == 120
    assert {len(data) for topic, data, _ in old if topic == "/link/hand/rx"} == {232}
    writer = TrafficWriter(tmp_path / "new.mcap")
    for topic, data, stamp_ns in old:
        writer.write(topic, data, stamp_ns)
    writer.close()
    assert content(tmp_path / "new.mcap") == old
    assert TrafficReader(tmp_path / "new.mcap").info["format"] == "tactile-traffic/2"


@settings(max_examples=50, deadline=None, derandomize=True)
@given(
    payload=st.binary(max_size=300),
    stamp_ns=st.integers(0, 2**60),
    counter=st.none() | st.integers(0, 2**32),
    clock_ns=st.none() | st.integers(0, 2**62),
)
def test_a_raw_frame_says_what_was_put_in(payload, stamp_ns, counter, clock_ns):
    device = DeviceStamp(counter, clock_ns)
    assert raw_frames.decode(raw_frames.encode(payload, stamp_ns, device)) == (payload, device)


@pytest.mark.parametrize("changes", [{}, {"format": "tactile-session/2", "streams": {}}])
def test_a_description_of_an_older_version_is_read_and_written_anew(tmp_path, changes):
    (tmp_path / "session.yaml").write_text(yaml.safe_dump({**MANIFEST_1, **changes}))
    manifest = read_manifest(tmp_path)
    assert (manifest.format, manifest.counts, manifest.streams) == ("tactile-session/3", {"grasps": 2}, {})
    assert (manifest.derived, manifest.recorded_here) == ((), True)
    write_manifest(tmp_path, manifest)
    assert read_manifest(tmp_path) == manifest


@pytest.mark.parametrize(
    ("form", "words"),
    [
        ("tactile-session/4", "a newer version of the program"),
        ("tactile-session/99", "or a newer one"),
        ("tactile-session/0", "a format that this program does not know"),
        ("tactile-session/x", "a format that this program does not know"),
        ("another/7", "a format that this program does not know"),
        (2, "a format that this program does not know"),
    ],
)
def test_a_description_of_an_unknown_version_is_refused(tmp_path, form, words):
    (tmp_path / "session.yaml").write_text(yaml.safe_dump({**MANIFEST_1, "format": form}))
    with pytest.raises(SessionError, match=words):
        read_manifest(tmp_path)


def test_a_recording_of_a_newer_version_is_refused(tmp_path):
    file = CutBackFile(tmp_path / "t.mcap")
    writer = McapWriter(file, None, PROFILE, "")
    writer.add_metadata(PROFILE, {"format": "tactile-traffic/7"})
    writer.finish()
    file.close()
    with pytest.raises(SessionError, match=r"tactile-traffic/7.*a newer version of the program"):
        TrafficReader(tmp_path / "t.mcap")


def test_there_is_a_converter_for_every_older_version():
    for form in formats.TRAFFIC_FORMATS:
        assert (
            formats.traffic_converter(form, "")((schemas.SESSION_EVENTS_TOPIC, b"{}", 1))[0]
            == schemas.SESSION_EVENTS_TOPIC
        )
    for form in formats.MANIFEST_FORMATS:
        assert formats.converted_manifest({"format": form}, "")["format"] == formats.MANIFEST_FORMATS[-1]


@pytest.mark.parametrize("data", [b"", bytes(10), bytes(40)])
def test_a_hand_made_frame_that_is_none_is_named(data):
    with pytest.raises(ValueError, match="raw frame"):
        raw_frames.decode(data)
