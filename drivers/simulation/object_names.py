"""Names of the objects of the simulated rig: meshes are named by their file and resting pose.

This module loads no mesh library: the command line needs only the names.
"""

from __future__ import annotations

import re
from pathlib import Path

from drivers.core.errors import ConfigurationError

MESH_PREFIX = "mesh:"
STANDING, LYING = "standing", "lying"
_POSED = re.compile(rf"^(?P<path>.+)@(?P<pose>{STANDING}|{LYING}|[0-9]+)$")


def in_pose(name: str, pose: str) -> str:
    """The name of a mesh object in a given resting pose: ``mesh:<path>@<pose>``.

    Args:
        name: ``mesh:<path>``.
        pose: ``standing``, ``lying``, or a number from 1, the most probable resting pose.

    Raises:
        ConfigurationError: there is no such pose, or the object is not a mesh.
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
    """The file and the pose of the mesh named ``mesh:<path>`` or ``mesh:<path>@<pose>``."""
    found = _POSED.match(name)
    path = Path((found["path"] if found else name).removeprefix(MESH_PREFIX))
    return path, found["pose"] if found else STANDING


def headline(name: str) -> str:
    """An object as people call it: of a mesh the file's name without suffix, and its pose where the name says one."""
    if not name.startswith(MESH_PREFIX):
        return name
    path, pose = posed_path(name)
    if not _POSED.match(name):
        return path.stem
    return f"{path.stem}, {f'pose {pose}' if pose.isdigit() else pose}"
