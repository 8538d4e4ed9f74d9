"""Names of sessions."""

from __future__ import annotations

from sessions.recording.session_ids import slug


def test_the_id_of_a_mesh_names_its_file_alone() -> None:
    assert slug("mesh:/data/Soup can.ply") == "soup-can"
