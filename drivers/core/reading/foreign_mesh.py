"""Mesh files: those in a few formats, and of what they refer to the plain files beside them."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import trimesh

from drivers.core.errors import ConfigurationError
from drivers.core.reading.bounded_files import LARGEST_MESH_bytes, read_bounded, read_input

FORMATS = (".ply", ".stl", ".obj", ".glb", ".gltf", ".off", ".3mf")
"""Other formats of trimesh, archives and drawings among them, take minutes for what a few kilobytes say."""


class _ElsewhereError(Exception):
    """A mesh names a file in another folder; not a ValueError, which readers take for a file that is not there."""


class _Beside(trimesh.resolvers.Resolver):
    """Materials, pictures and buffers that a mesh names, from its own folder.

    Args:
        folder: of the mesh.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def get(self, name: str) -> bytes:
        """The content of a file. Raises OSError, ConfigurationError, _ElsewhereError for one in another folder."""
        if not (path := (self._folder / name).resolve()).is_relative_to(self._folder.resolve()):
            raise _ElsewhereError(f"names {name!r}, which is in another folder")
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
        ConfigurationError: it cannot be read, is too large, a pipe or device, of another format, or damaged.
    """
    suffix = path.suffix.lower()
    if suffix not in FORMATS:
        what = f"is not a mesh that can be read: {suffix or 'a name without a suffix'} is none of its formats"
        raise ConfigurationError(what, where=str(path), hint="Give a PLY, STL, OBJ or GLB file")
    content = io.BytesIO(read_input(path, LARGEST_MESH_bytes))
    try:
        return trimesh.load(content, file_type=suffix[1:], resolver=_Beside(path.parent), **options)
    except _ElsewhereError as error:
        raise ConfigurationError(str(error), where=str(path), hint="Put what it names beside it") from error
    except ConfigurationError:  # of a file beside it
        raise
    except Exception as error:  # each format's reader fails in its own way, and words, on bytes that do not follow it
        what = f"is damaged, or not a {suffix[1:].upper()} file"
        raise ConfigurationError(what, where=str(path), hint="Export the mesh again") from error
