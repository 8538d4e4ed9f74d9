"""A session for Rerun: as a file, or sent to its viewer."""

from __future__ import annotations

import socket
from pathlib import Path
from urllib.parse import urlsplit

import rerun as rr

from drivers.core.errors import ConfigurationError, refusal
from tactile_lab.viewers.new_files import new_file
from tactile_lab.viewers.recorded_items import RecordedItems
from tactile_lab.viewers.rerun_log import RerunLog, blueprint

APPLICATION = "tactile-lab"
_PORT, _PATIENCE_s = 9876, 5.0
_BATCHES = rr.ChunkBatcherConfig(flush_tick=30.0, flush_num_bytes=2_000_000, flush_num_rows=1_000_000)
"""Rerun's own batches are for live data: a file of them is ten times as large."""


def write_rerun(path: Path, items: RecordedItems, name: str) -> int:
    """Write a new ``.rrd`` file; nothing is left of one that cannot be completed. Returns the number of items.

    Args:
        items: of a session.
        name: of the recording in the viewer.

    Raises:
        ConfigurationError: the file exists.
        WriteError: it cannot be written.
    """
    with new_file(path) as partial:
        partial.touch()  # what cannot be written is told before anything is computed
        stream = rr.RecordingStream(APPLICATION, recording_id=name, batcher_config=_BATCHES)
        stream.save(partial, default_blueprint=blueprint())
        return _send(stream, items)


def show_in_rerun(items: RecordedItems, name: str, address: str = "") -> int:
    """Send a session to Rerun's viewer. Returns the number of items.

    Args:
        items: of a session.
        name: of the recording in the viewer.
        address: of a running viewer, such as ``rerun+http://127.0.0.1:9876/proxy``; without, one is started here.

    Raises:
        ConfigurationError: the viewer cannot be started, or there is none at the address.
    """
    if address:
        _check_answers(address)
    stream = rr.RecordingStream(APPLICATION, recording_id=name, batcher_config=_BATCHES)
    try:
        if address:
            stream.connect_grpc(address, default_blueprint=blueprint())
        else:
            stream.spawn(default_blueprint=blueprint())
        return _send(stream, items)
    except (OSError, RuntimeError, ValueError) as error:
        raise _unreachable(str(error)) from error


def _check_answers(address: str) -> None:
    """Raises ConfigurationError where nothing listens: Rerun itself would say so only after everything was computed."""
    try:
        parts = urlsplit(address.removeprefix("rerun+"))
        socket.create_connection((parts.hostname or "", parts.port or _PORT), timeout=_PATIENCE_s).close()
    except (OSError, ValueError) as error:
        raise _unreachable(f"{address}: {refusal(error) if isinstance(error, OSError) else error}") from error


def _unreachable(why: str) -> ConfigurationError:
    hint = "Start it with the command rerun, or write a file: tactile-lab session export NAME --rerun FILE.rrd"
    return ConfigurationError(f"its viewer cannot be reached ({why})", where="rerun", hint=hint)


def _send(stream: rr.RecordingStream, items: RecordedItems) -> int:
    try:
        count = RerunLog(stream, items.robot).log(items)
        stream.flush(timeout_sec=60.0)
        return count
    finally:
        stream.disconnect()
