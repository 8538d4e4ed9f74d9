"""Pieces cut out of a session: which seconds, which transports, and the calibration inside."""

from __future__ import annotations

from pathlib import Path

import pytest

from drivers.core.errors import ConfigurationError
from sessions.exchange.extracting import Piece, extract
from sessions.recording.running_session import create_session
from sessions.recording.session import TRAFFIC, Session
from sessions.recording.traffic.reader import TrafficReader

SECOND_ns = 1_000_000_000


@pytest.fixture
def session(tmp_path: Path) -> Session:
    """Four seconds of two transports, with a calibration file."""
    joints = tmp_path / "joints.yaml"
    joints.write_text("a: 1\n")
    running = create_session(
        tmp_path / "runs",
        rig="sim",
        rig_description={},
        object_name="box",
        calibration_files={"joints": joints},
    )
    with running:
        for second in range(4):
            running.recorder.on_received("hand", bytes([second]), second * SECOND_ns)
            running.recorder.on_received("base", bytes([10 + second]), second * SECOND_ns + 1)
    return Session.open(running.folder)


def payloads(folder: Path) -> list[bytes]:
    return [message.data for message in TrafficReader(folder / TRAFFIC).messages()]


def attached(folder: Path) -> list[str]:
    return [item.name for item in TrafficReader(folder / TRAFFIC).attachments()]


def test_seconds_count_from_the_first_message_and_the_last_is_left_out(session: Session, tmp_path: Path) -> None:
    counts = extract(session, tmp_path / "piece", Piece(from_s=1.0, to_s=3.0, transports=["hand"]))
    assert sum(counts.values()) == 2
    assert [data[-1] for data in payloads(tmp_path / "piece")] == [1, 2]


def test_the_calibration_is_kept_inside_unless_it_is_not_wanted(session: Session, tmp_path: Path) -> None:
    extract(session, tmp_path / "with", Piece())
    extract(session, tmp_path / "without", Piece(attachments=False))
    assert any("joints" in name for name in attached(tmp_path / "with"))
    assert attached(tmp_path / "without") == []
    assert (tmp_path / "without" / "calibration" / "joints.yaml").is_file()


def test_what_is_not_there_is_named_and_leaves_no_folder(session: Session, tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="camera"):
        extract(session, tmp_path / "piece", Piece(transports=["camera", "hand"]))
    with pytest.raises(ConfigurationError, match="nothing was recorded"):
        extract(session, tmp_path / "piece", Piece(from_s=60.0))
    assert not (tmp_path / "piece").exists()
