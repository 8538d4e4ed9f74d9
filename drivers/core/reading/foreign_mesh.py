"""Mesh files: those in a few formats, and of what they refer to the plain files beside them."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import trimesh

from drivers.core.reading.bounded_files import LARGEST_MESH_bytes, read_bounded

FORMATS = (".ply", ".stl", ".obj", ".glb", ".gltf", ".off", ".3mf")
"""Other formats of trimesh, archives and drawings among them, take minutes for what a few kilobytes say."""


class _Beside(trimesh.resolvers.Resolver):
    """Materials, pictures and buffers that a mesh names, from its own folder.

    Args:
        folder: of the mesh.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def get(self, name: str) -> bytes:
        """The content of a file. Raises OSError, ConfigurationError, ValueError for one elsewhere."""
        if not (path := (self._folder / name).resolve()).is_relative_to(self._folder.resolve()):
            raise ValueError(f"{name!r} is in another folder")
        return read_bounded(path, LARGEST_MESH_bytes)

    def write(self, name: str, data: Any) -> None:
        """Reading writes nothing."""
        raise NotImplementedError

    def namespaced(self, namespace: str) -> _Beside:
        """Of a folder in it."""
        return _Beside(self._folder / namespace)

    def keys(self) -> list[str]:
        """Names of files beside the mesh."""
        return [item.name for item in self._folder.iterdir() if item.is_file()]


def load_foreign_mesh(path: Path, **options: Any) -> Any:
    """What trimesh makes of a file.

    Args:
        path: of the file.
        options: of :func:`trimesh.load`.

    Raises:
        OSError: it cannot be read.
        ConfigurationError: it is too large, or a pipe or device.
        ValueError: it is of another format.
        Exception: each format's reader fails in its own way on bytes that do not follow it.
    """
    suffix = path.suffix.lower()
    if suffix not in FORMATS:
        raise ValueError(f"{suffix or 'no suffix'} is no format of meshes")
    content = io.BytesIO(read_bounded(path, LARGEST_MESH_bytes))
    return trimesh.load(content, file_type=suffix[1:], resolver=_Beside(path.parent), **options)
