"""Hostile sessions: recordings, descriptions, results, archives."""

from __future__ import annotations

import os
import random
import shutil
import struct
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path

import zstandard

from tests.support.hostile.case import FILE, Case, Kind
from tests.support.hostile.texts import MB

_MAGIC = b"\x89MCAP0\r\n"
_REPLAY = Kind("recording", ("session", "replay", FILE), "")
_RECOVER = Kind("recording, recovered", ("session", "recover", FILE), "")
_SHOW = Kind("session description", ("session", "show", FILE), "")
_EVALUATE = Kind("results", ("evaluate", FILE), "")
_REPORT = Kind("results, reported", ("report", FILE), "")
_IMPORT = Kind("archive", ("session", "import", FILE, "--root", "imported"), ".zip")
_CATALOGUE = Kind("catalogue", ("session", "catalogue", FILE, "--out", "catalogue.csv"), "")
_EXPERIMENT = Kind("results of an experiment", ("experiment", "methods-2d", "--grasps", "1", "--out", FILE), "")
_NOISE = random.Random(2).randbytes(20 * MB)

Content = bytes | Callable[[Path], None]


def recording_cases(session: Path) -> Iterator[Case]:
    """All of them. ``session`` is a sound one, of which copies are spoiled."""
    traffic = (session / "traffic.mcap").read_bytes()
    streams = _streams(traffic)
    yield from _REPLAY.cases({name: _spoil(session, "traffic.mcap", content) for name, content in streams.items()})
    chosen = ("a chunk of 1 GB, packed", "noise", "a million small records")
    yield from _RECOVER.cases({name: _spoil(session, "traffic.mcap", streams[name]) for name in chosen})
    for kind in (_REPLAY, _RECOVER):
        yield from kind.cases({"a pipe": _spoil(session, "traffic.mcap", os.mkfifo)})
    yield from _REPLAY.cases(
        {
            "a calibration that is a pipe": _spoil(session, "calibration/joints.yaml", os.mkfifo),
            "a second file that is a pipe": _spoil(session, "traffic-2.mcap", os.mkfifo),
            "results of 50 kB of brackets": _spoil(session, "results/slam.json", b"[" * 50_000),
        }
    )
    deep = _spoil(session, "results/evaluation.json", b"[" * 50_000)
    yield from _CATALOGUE.cases({"an evaluation of 50 kB of brackets": lambda path: deep(path / "session")})
    yield from _EXPERIMENT.cases({name: _results_file(content) for name, content in _experiments().items()})
    yield from _SHOW.cases({name: _spoil(session, "session.yaml", text) for name, text in _descriptions().items()})
    for kind, file, contents in (
        (_EVALUATE, "results/trajectory.csv", _trajectories()),
        (_REPORT, "results/evaluation.json", {"20 kB of brackets": b"[" * 20_000, "16 MB of brackets": b"[" * 16 * MB}),
        (_REPORT, "results/slam.json", {"noise": _NOISE[:MB], "17 MB": b" " * (17 * MB)}),
    ):
        yield from kind.cases({f"{file}: {name}": _spoil(session, file, content) for name, content in contents.items()})
    yield from _IMPORT.cases(_archives())


def _spoil(session: Path, file: str, content: Content) -> Callable[[Path], None]:
    """A copy of a session with another file, or with one that is made at its place."""

    def make(path: Path) -> None:
        shutil.copytree(session, path)
        (path / file).unlink(missing_ok=True)
        if isinstance(content, bytes):
            (path / file).write_bytes(content)
        else:
            content(path / file)

    return make


def _experiments() -> dict[str, bytes]:
    """Files of results of an experiment that is to be resumed."""
    head = b'{"format": "tactile-experiment/1", "experiment": "methods-2d", "version": '
    return {
        "50 kB of brackets": head + b"[" * 50_000,
        "noise": _NOISE[:MB],
        "201 MB": b" " * (201 * MB),
        "a million runs that are none": head + b'"x"}\n' + b"{}\n" * MB,
    }


def _results_file(content: bytes) -> Callable[[Path], None]:
    def make(path: Path) -> None:
        path.mkdir()
        (path / "runs.jsonl").write_bytes(content)

    return make


# --- recordings ----------------------------------------------------------------------------------------------------


def _streams(sound: bytes) -> dict[str, bytes]:
    blanks = zstandard.compress(bytes(1 << 30))
    head = sound[: sound.index(b"\x06", 8)] if b"\x06" in sound else sound[:8]
    return {
        "empty": b"",
        "noise": _NOISE,
        "noise behind the head": _MAGIC + _NOISE,
        "20 MB of zeros": _MAGIC + bytes(20 * MB),
        "a chunk of 1 GB, packed": head + _chunk(1 << 30, blanks),
        "a chunk of 1 GB that says 1 MB": head + _chunk(1 << 20, blanks),
        "a record of 2^63 bytes": _MAGIC + struct.pack("<BQ", 5, 1 << 63) + bytes(1000),
        "a million small records": _MAGIC + struct.pack("<BQ", 0x0C, 8) * MB,
        "two million empty records": _MAGIC + struct.pack("<BQ", 5, 0) * (2 * MB),
        "a million chunks without content": _MAGIC + _chunk(0, b"") * 300_000,
        "heads of chunks, one in another": _MAGIC + (b"\x06" + bytes(40) + b"zstd") * 400_000,
        "a text of 4 GB": _MAGIC + struct.pack("<BQI", 1, 8, 0xFFFFFFFF) + bytes(4),
        "a summary that points at itself": sound[:-28]
        + struct.pack("<QQI", len(sound) - 37, len(sound) - 37, 0)
        + _MAGIC,
        "its middle twice": sound[: len(sound) // 2] + sound[len(sound) // 4 :],
    }


def _chunk(size: int, packed: bytes) -> bytes:
    content = (
        struct.pack("<QQQI", 0, 1, size, 0) + struct.pack("<I", 4) + b"zstd" + struct.pack("<Q", len(packed)) + packed
    )
    return struct.pack("<BQ", 6, len(content)) + content


def _descriptions() -> dict[str, bytes]:
    return {
        "noise": _NOISE[:100_000],
        "20 kB of brackets": b"[" * 20_000,
        "33 000 keys": b"".join(b"key%05d: 1\n" % n for n in range(33_000)),
        "15 MB": b"a: 1\n" * (3 * MB),
    }


def _trajectories() -> dict[str, bytes]:
    return {
        "noise": _NOISE[:MB],
        "two million columns": b"a," * (2 * MB),
        "17 MB": b"1,2,3\n" * (3 * MB),
        "15 MB of equal lines": b"grasp,x_m\n" + b"1,2\n" * (15 * MB // 4),
    }


# --- archives ------------------------------------------------------------------------------------------------------


def _archives() -> dict[str, Content]:
    return {
        "noise": _NOISE,
        "300 MB of zeros, packed": lambda path: _zipped(path, {"s/traffic.mcap": 300 * MB}),
        "500 files of 1 MB of zeros": lambda path: _zipped(path, {f"s/results/{n}": MB for n in range(500)}),
        "20 000 files": lambda path: _zipped(path, {f"s/{n}": 1 for n in range(20_000)}),
        "names that leave the folder": lambda path: _zipped(path, {"s/../../../tmp/x": 10, "s/session.yaml": 10}),
        "an absolute name": lambda path: _zipped(path, {"/tmp/x": 10}),
        "a link": _linked,
        "two files of one name": _doubled,
        "a size that is not true": _understated,
        "no session in it": lambda path: _zipped(path, {"s/letter.txt": 100}),
        "a directory of 400 000 entries": lambda path: _overlapping(path, 400_000),
    }


def _zipped(path: Path, sizes: dict[str, int]) -> None:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, size in sizes.items():
            with archive.open(name, "w", force_zip64=True) as file:
                for _ in range(size // MB):
                    file.write(bytes(MB))
                file.write(bytes(size % MB))


def _linked(path: Path) -> None:
    with zipfile.ZipFile(path, "w") as archive:
        entry = zipfile.ZipInfo("s/session.yaml")
        entry.external_attr = 0o120777 << 16
        archive.writestr(entry, "/etc/passwd")


def _doubled(path: Path) -> None:
    _zipped(path, {"s/session.yaml": 10, "s/session.yamL": 10})
    path.write_bytes(path.read_bytes().replace(b"session.yamL", b"session.yaml"))


def _understated(path: Path) -> None:
    """One file of 100 MB whose entry in the directory says 1 kB."""
    _zipped(path, {"s/session.yaml": 100 * MB})
    content = bytearray(path.read_bytes())
    entry = content.rindex(b"PK\x01\x02")
    content[entry + 24 : entry + 28] = struct.pack("<I", 1000)
    path.write_bytes(content)


def _overlapping(path: Path, count: int) -> None:
    """A small file that names its only content very many times."""
    _zipped(path, {"s/a": 100})
    content = path.read_bytes()
    begin, end = content.index(b"PK\x01\x02"), content.rindex(b"PK\x05\x06")
    entries = content[begin:end] * count
    tail = struct.pack("<4sHHHHIIH", b"PK\x05\x06", 0, 0, 0xFFFF, 0xFFFF, len(entries), begin, 0)
    path.write_bytes(content[:begin] + entries + tail)
