"""Hostile meshes and pictures."""

from __future__ import annotations

import json
import os
import struct
import tarfile
import zipfile
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path

import trimesh

from tests.support.hostile.case import FILE, Case, Kind
from tests.support.hostile.texts import MB

_RUN = ("run", "--grasps", "1", "--method", "odometry", "--out", "runs")
_BOARD = ("calibrate", "camera", FILE, "--no-input", "--out", "lens.yaml")
_PLY = "ply\nformat {form} 1.0\nelement vertex {vertices}\nproperty float x\nproperty float y\nproperty float z\n"
_FACES = "element face {faces}\nproperty list {count} int vertex_indices\nend_header\n"

Content = bytes | str | Callable[[Path], None]


def shape_cases() -> Iterator[Case]:
    """All of them."""
    for suffix, contents in _meshes().items():
        yield from Kind("mesh", (*_RUN, "--object", f"mesh:{FILE}"), suffix).cases(contents)
    yield from Kind("pictures", _BOARD, "").cases(_pictures())


def _meshes() -> dict[str, dict[str, Content]]:
    return {
        ".stl": {
            "a promise of 4 billion triangles": bytes(80) + struct.pack("<I", 0xFFFFFFFF) + bytes(500),
            "half of its triangles": _sphere(3, "stl")[: len(_sphere(3, "stl")) // 2],
            "text without an end": "solid x\n" + "facet normal 0 0 1\nouter loop\n" * 200_000,
            "65 MB": lambda path: _long_file(path, 65 * MB),
            "330 000 triangles": _sphere(7, "stl", 0.05),
        },
        ".ply": {
            "a promise of a billion corners": _ply("binary_little_endian", 10**9, 10**9),
            "a promise in text": _ply("ascii", 10**9, 10**9),
            "a face of 255 corners": _ply("ascii", 3, 1) + "0 0 0\n1 0 0\n0 1 0\n" + "255 " + "0 " * 255,
            "corners that are not there": _ply("ascii", 3, 1) + "0 0 0\n.1 0 0\n0 .1 0\n3 7 8 9999999\n",
            "places that are no numbers": _ply("ascii", 3, 1) + "nan inf 0\n.1 0 0\n0 .1 0\n3 0 1 2\n",
            "a head of 5 MB": "ply\n" + "comment x\n" * (5 * MB // 10),
        },
        ".obj": {
            "a million faces on three corners": "v 0 0 0\nv 1 0 0\nv 0 1 0\n" + "f 1 2 3\n" * MB,
            "one face of a million corners": "v 0 0 0\n" * 1000 + "f" + " 1 2 3 4 5" * 200_000,
            "materials that are devices": "mtllib /dev/zero\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
            "materials that are a pipe": lambda path: _with_pipe(path, "mtllib pipe\n" + _TRIANGLE),
            "all corners at one place": "v 0.1 0.1 0.1\n" * 10_000
            + "".join(f"f {n} {n + 1} {n + 2}\n" for n in range(1, 9000)),
        },
        ".glb": {
            "a promise of 4 GB": struct.pack("<4sIIII", b"glTF", 2, 0xFFFFFFFF, 0xFFFFFFFF, 0x4E4F534A),
            "views beyond its end": _glb({"bufferViews": [{"buffer": 0, "byteOffset": 0, "byteLength": 2**40}]}),
            "a node that is its own child": _glb(
                {"nodes": [{"children": [0]}], "scenes": [{"nodes": [0]}], "scene": 0}
            ),
            "an accessor of a billion zeros": _glb(_ZEROS),
        },
        ".gltf": {
            "a buffer that is a pipe": lambda path: _with_pipe(path, _gltf("pipe")),
            "a buffer that is another file": _gltf("../../../../../../etc/passwd"),
            "a buffer elsewhere": _gltf("http://127.0.0.1:9/x"),
        },
        ".tar.gz": {"300 MB of zeros, packed": _packed_tar},
        ".xyz": {"three million points": "0 0 0\n" * (3 * MB)},
        ".dxf": {"two million lines": "0\nSECTION\n2\nENTITIES\n" + "0\nLINE\n" * (2 * MB)},
        ".off": {"a billion corners in text": "OFF\n1000000000 1000000000 0\n0 0 0\n"},
        ".3mf": {"300 MB of blanks, packed": lambda path: _packed_blanks(path, "3D/3dmodel.model")},
        ".dae": {"entities of entities": _LAUGHS},
        ".zip": {"an archive of 300 MB of blanks": lambda path: _packed_blanks(path, "a.stl")},
    }


_TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
_LAUGHS = (
    '<?xml version="1.0"?><!DOCTYPE x [<!ENTITY l0 "ha">'
    + "".join(f'<!ENTITY l{n} "{f"&l{n - 1};" * 10}">' for n in range(1, 12))
    + "]><COLLADA>&l11;</COLLADA>"
)
_ZEROS = {
    "accessors": [
        {"componentType": 5126, "count": 10**9, "type": "VEC3"},
        {"componentType": 5125, "count": 3 * 10**8, "type": "SCALAR"},
    ],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
    "nodes": [{"mesh": 0}],
    "scenes": [{"nodes": [0]}],
    "scene": 0,
}


def _ply(form: str, vertices: int, faces: int) -> str:
    return (_PLY + _FACES).format(form=form, vertices=vertices, faces=faces, count="uchar")


def _glb(content: dict[str, object]) -> bytes:
    text = json.dumps({"asset": {"version": "2.0"}, **content}).encode()
    text += b" " * (-len(text) % 4)
    return struct.pack("<4sIIII", b"glTF", 2, 20 + len(text), len(text), 0x4E4F534A) + text


def _gltf(buffer: str) -> str:
    """A triangle whose corners are in another file."""
    return json.dumps(
        {
            "asset": {"version": "2.0"},
            "buffers": [{"uri": buffer, "byteLength": 36}],
            "bufferViews": [{"buffer": 0, "byteLength": 36}],
            "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
            "nodes": [{"mesh": 0}],
            "scenes": [{"nodes": [0]}],
            "scene": 0,
        }
    )


def _with_pipe(path: Path, content: str) -> None:
    os.mkfifo(path.with_name("pipe"))
    path.write_text(content)


def _packed_tar(path: Path) -> None:
    entry = tarfile.TarInfo("a.stl")
    entry.size = 300 * MB
    with tarfile.open(path, "w:gz") as archive, Path("/dev/zero").open("rb") as zeros:
        archive.addfile(entry, zeros)


def _sphere(levels: int, form: str, radius_m: float = 0.03) -> bytes:
    sphere = trimesh.creation.icosphere(levels, radius_m)
    exported = sphere.export(file_type=form)
    assert isinstance(exported, bytes)
    return exported


def _long_file(path: Path, size: int) -> None:
    with path.open("wb") as file:
        file.truncate(size)


def _packed_blanks(path: Path, name: str) -> None:
    """A ZIP file that unpacks to a thousand times its size."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive, archive.open(name, "w", force_zip64=True) as file:
        for _ in range(300):
            file.write(b" " * MB)


# --- pictures ------------------------------------------------------------------------------------------------------


def _pictures() -> dict[str, Content]:
    return {
        "30 000 x 30 000 pixels, packed": lambda folder: _picture(folder, png(30_000, 30_000)),
        "a promise of 2 billion pixels a line": lambda folder: _picture(folder, png(2**31 - 1, 1, rows=0)),
        "noise": lambda folder: _picture(folder, bytes(range(256)) * 400),
        "a film of zeros": lambda path: _long_file(path.with_suffix(""), 20 * MB),
        "a picture that is a device": _picture_device,
        "a picture that is a pipe": _picture_pipe,
    }


def png(width: int, height: int, rows: int | None = None) -> bytes:
    """A black picture of one bit a pixel, packed as small as it goes."""

    def piece(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    packer, line = zlib.compressobj(9), bytes(1 + (width + 7) // 8) if rows != 0 else b""
    data = b"".join(packer.compress(line) for _ in range(height if rows is None else rows)) + packer.flush()
    head = struct.pack(">IIBBBBB", width, height, 1, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + piece(b"IHDR", head) + piece(b"IDAT", data) + piece(b"IEND", b"")


def _picture(folder: Path, content: bytes) -> None:
    folder.mkdir()
    (folder / "view.png").write_bytes(content)


def _picture_device(folder: Path) -> None:
    folder.mkdir()
    (folder / "view.png").symlink_to("/dev/zero")


def _picture_pipe(folder: Path) -> None:
    folder.mkdir()
    os.mkfifo(folder / "view.png")
