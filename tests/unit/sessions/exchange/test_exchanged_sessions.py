"""Pieces, archives and tables of sessions, and the words for what goes wrong elsewhere: as before."""

from __future__ import annotations

import errno
import shutil
import zipfile
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from sessions.exchange import addresses
from sessions.exchange.archives import ArchiveLimits, export_archive, import_archive
from sessions.exchange.extracting import Piece, extract
from sessions.exchange.parquet_tables import unit_of, write_parquet
from sessions.exchange.sample_tables import SampleTables
from sessions.exchange.table_files import picture_suffix, rows_of, write_csv, write_hdf5
from sessions.recording.running_session import create_session
from sessions.recording.session import Session
from tests.support.baseline import assert_baseline
from tests.support.said import said


@pytest.fixture
def session(tmp_path: Path) -> Session:
    joints = tmp_path / "joints.yaml"
    joints.write_text("a: 1\n")
    made = create_session(
        tmp_path, rig="sim", rig_description={}, object_name="box", calibration_files={"joints": joints}
    )
    with made:
        for n in range(20):
            made.recorder.on_received("hand", bytes([n]) * 8, 100_000_000 * n)
            made.recorder.on_transmitted("hand", b"x", 100_000_000 * n)
            made.recorder.on_received("ft/FF", bytes([n]), 100_000_000 * n + 1)
            made.recorder.loads(100_000_000 * n, {"FF": 0.5})
    return Session.open(made.folder)


def test_pieces_of_a_session(session: Session, tmp_path: Path) -> None:
    pieces = {
        "all": Piece(),
        "with-samples": Piece(samples=True),
        "begin": Piece(to_s=0.5),
        "end": Piece(from_s=1.5),
        "middle": Piece(0.5, 1.0, {"hand"}),
        "bare": Piece(transports={"ft/FF"}, attachments=False),
        "unknown": Piece(transports={"hand", "foot"}),
        "nothing": Piece(from_s=9.0),
    }
    told = {}
    for name, piece in pieces.items():
        told[name] = said(
            lambda name=name, piece=piece: extract(session, tmp_path / name, piece), session.folder, tmp_path
        )
        if not isinstance(told[name], str):
            made = Session.open(tmp_path / name)
            files = [one.name for one in made.traffic().attachments()]
            told[name] |= {
                "files": files,
                "how": [step.how for step in made.manifest.derived],
                "status": made.manifest.status,
            }
    told["left"] = sorted(path.name for path in tmp_path.iterdir() if path.name in pieces)
    told["again"] = said(lambda: extract(session, tmp_path / "all", Piece()), tmp_path)
    told["bad name"] = said(lambda: extract(session, tmp_path / "A B", Piece()), tmp_path)
    assert_baseline("sessions/exchange/pieces", told)


def test_archives_at_their_limits(session: Session, tmp_path: Path) -> None:
    whole = tmp_path / "whole.zip"
    count = export_archive(session, whole)
    sizes = [item.stat().st_size for item in session.folder.rglob("*") if item.is_file()]
    limits = {
        "as many files": ArchiveLimits(files=count),
        "more files": ArchiveLimits(files=count - 1),
        "as many bytes": ArchiveLimits(total_bytes=sum(sizes)),
        "more bytes": ArchiveLimits(total_bytes=sum(sizes) - 1),
    }
    told: dict[str, Any] = {}

    def taken(what: str, path: Path, limit: ArchiveLimits | None = None, name: str | None = None) -> None:
        root = tmp_path / "root"
        found = said(lambda: import_archive(path, root, name, limit), tmp_path, session.folder)
        words = found if isinstance(found, str) else f"taken: {[step.how for step in found.manifest.derived]}"
        told[what] = words.replace(str(sum(sizes)), "all").replace(str(sum(sizes) - 1), "all but one")
        shutil.rmtree(root, ignore_errors=True)

    for name, limit in limits.items():
        taken(name, whole, limit)
    entries: dict[str, dict[str, bytes]] = {
        "nothing": {},
        "no session": {"a/b.txt": b"x"},
        "beside": {"a/session.yaml": b"x", "a/traffic.mcap": b"x", "b.txt": b"x"},
        "two": {"a/session.yaml": b"x", "b/session.yaml": b"x"},
        "upwards": {"../session.yaml": b"x"},
        "absolute": {"/session.yaml": b"x"},
        "drive": {"c:/session.yaml": b"x"},
        "six deep": {"a/b/c/d/e/session.yaml": b"x"},
        "seven deep": {"a/b/c/d/e/f/session.yaml": b"x"},
        "no traffic": {"a/session.yaml": b"x"},
        "same name": {"a/session.yaml": b"x", "a\\session.yaml": b"y"},
        "desktop": {"__MACOSX/a/session.yaml": b"x", ".DS_Store": b"x"},
        "zeros": {"a/session.yaml": bytes(2_000_000)},
    }
    for name, files in entries.items():
        path = tmp_path / f"{name}.zip"
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            for place, content in files.items():
                archive.writestr(place, content)
        taken(name, path)
    taken("zeros that are believed", tmp_path / "zeros.zip", ArchiveLimits(ratio=5000.0))
    (tmp_path / "text.zip").write_text("no archive")
    taken("text", tmp_path / "text.zip")
    taken("missing", tmp_path / "missing.zip")
    taken("bad name", whole, name="A B")
    assert_baseline("sessions/exchange/archives", told)


def test_tables_of_samples(tmp_path: Path) -> None:
    tables = SampleTables()
    for n in range(3):
        tables.table("joints", ["FFJ1_rad"]).add(1_000_000_000 * n + n, np.array([0.5 * n]))
        tables.table("events", ("level", "message")).add(n, (n, f"word {n}"))
    tables.pictures += [(7, b"\x89PNG one"), (8, b"\xff\xd8 two")]
    written = [write_csv(tables, tmp_path / "csv"), write_hdf5(tables, tmp_path / "samples.h5"), rows_of(tables)]
    found = {str(path.relative_to(tmp_path)): path.read_text() for path in sorted((tmp_path / "csv").glob("*.csv"))}
    with h5py.File(tmp_path / "samples.h5") as file:
        names: list[str] = []
        file.visit(names.append)
        stored = {
            "names": names,
            "format": str(file.attrs["format"]),
            "stamps": file["joints/stamp_ns"][:],
            "rad": file["joints/FFJ1_rad"][:],
        }
        stored["words"] = [word.decode() for word in file["events/message"][:]]
    told: dict[str, Any] = {"written": written, "csv": found, "hdf5": stored}
    told["pictures"] = sorted(path.name for path in (tmp_path / "csv" / "pictures").iterdir())
    told["again"] = [
        said(lambda: write_csv(tables, tmp_path / "csv"), tmp_path),
        said(lambda: write_hdf5(tables, tmp_path / "samples.h5"), tmp_path),
    ]
    pytest.importorskip("pyarrow")
    folder = tmp_path / "parquet"
    told["parquet"] = [write_parquet(tables, folder), sorted(path.name for path in folder.iterdir())]
    told["parquet again"] = said(lambda: write_parquet(tables, folder), tmp_path)
    told["units"] = [unit_of(name) for name in ("FFJ1_rad", "x_m", "fx_N", "tx_Nm", "stamp_ns", "nx", "m", "kind_x")]
    told["suffixes"] = [picture_suffix(content) for content in (b"\x89PNG", b"\xff\xd8", b"")]
    assert_baseline("sessions/exchange/samples", told)


class StoreError(Exception):
    """As an object store answers."""

    def __init__(self, code: str) -> None:
        super().__init__(f"an answer of  many\nwords: {code}")
        self.response = {"Error": {"Code": code}}


class NoCredentialsError(Exception):
    """As boto's."""


def test_words_for_what_goes_wrong_elsewhere() -> None:
    nested = RuntimeError("outer")
    nested.__cause__ = StoreError("AccessDenied")
    errors: list[Exception] = [
        *(
            FileNotFoundError("x"),
            PermissionError("x"),
            StoreError("NoSuchBucket"),
            StoreError("NoSuchKey"),
            StoreError("404"),
        ),
        *(
            StoreError("403"),
            StoreError("500"),
            NoCredentialsError(),
            ValueError("Protocol not known: x"),
            ValueError("other"),
        ),
        *(OSError(errno.EACCES, "x"), OSError(errno.EROFS, "x"), OSError(errno.EIO, "x"), RuntimeError(""), nested),
        RuntimeError("w" * 300),
    ]
    told: dict[str, Any] = {
        "errors": [
            f"{type(addresses._explained(each, 'x://y')).__name__}: {addresses._explained(each, 'x://y')}"
            for each in errors
        ]
    }
    paths = ("a/b", "s3://b/c", "s3:/b/c", "file:/a/b", "local:///a", "c:/x", "S3://b", "s3://", "memory://x")
    told["addresses"] = {path: addresses.address_of(path) for path in paths}
    told["names"] = [
        said(lambda name=name: addresses.checked_name(name)) for name in ("a/b.c", "/a", "a/../b", "a\\b", "a:b", "")
    ]
    assert_baseline("sessions/exchange/elsewhere", told)
