"""A closed session of one message, for what copies and lists sessions."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from sessions.recording.running_session import create_session
from sessions.recording.session import Session


def short_session(root: Path) -> Session:
    """Record it into a folder of sessions; it has an evaluation of its own."""
    running = create_session(root, rig="sim", rig_description={}, object_name="box")
    with running:
        running.recorder.on_received("hand", np.random.default_rng(1).bytes(200_000), 1)  # does not become smaller
    results = running.folder / "results"
    results.mkdir(exist_ok=True)
    (results / "evaluation.json").write_text('{"method": "joint", "contacts": 9}')
    return Session.open(running.folder)


def files(folder: Path) -> dict[str, bytes]:
    """All files of a folder by their names in it."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}
