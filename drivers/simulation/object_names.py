"""How objects of the simulated rig are named: meshes by their file, and by the pose they rest in.

Nothing is loaded for it: the command line needs the names, the meshes' libraries only where there is a mesh.
"""

from __future__ import annotations

import re
from pathlib import Path

from drivers.core.errors import ConfigurationError

MESH_PREFIX = "mesh:"
STANDING, LYING = "standing", "lying"
_POSED = re.compile(rf"^(?P<path>.+)@(?P<pose>{STANDING}|{LYING}|[0-9]+)$")


def in_pose(name: str, pose: str) -> str:
    """The name of a mesh's object that rests in a pose: ``mesh:<path>@<pose>``.

    Args:
        name: ``mesh:<path>``.
        pose: ``standing``, ``lying``, or a number from 1, the most probable resting pose.

    Raises:
        ConfigurationError: there is no such pose, or the object is no mesh.
    """
    if not name.startswith(MESH_PREFIX):
        raise ConfigurationError(
            "only meshes can be laid down", where=name, hint=f"Give {MESH_PREFIX}FILE, or leave --pose out"
        )
    if not _POSED.match(posed := f"{name}@{pose}"):
        raise ConfigurationError(
            f"there is no pose {pose!r}", where=name, hint=f"Give {STANDING}, {LYING} or a number from 1"
        )
    return posed


def posed_path(name: str) -> tuple[Path, str]:
    """The file of the mesh called ``mesh:<path>`` or ``mesh:<path>@<pose>``, and its pose."""
    found = _POSED.match(name)
    path = Path((found["path"] if found else name).removeprefix(MESH_PREFIX))
    return path, found["pose"] if found else STANDING
