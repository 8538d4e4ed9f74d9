"""Names of sessions and what they say of the object."""

from __future__ import annotations

import pytest

from sessions.recording.session_ids import headline, slug


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("l-block", "l-block"),
        ("mesh:/data/soup can.ply", "soup can"),
        ("mesh:cups/mug.v2.stl@lying", "mug.v2, lying"),
        ("mesh:mug.stl@3", "mug, pose 3"),
    ],
)
def test_meshes_are_called_by_their_files_name(name: str, said: str) -> None:
    assert headline(name) == said


def test_the_id_of_a_mesh_names_its_file_alone() -> None:
    assert slug("mesh:/data/Soup can.ply") == "soup-can"
