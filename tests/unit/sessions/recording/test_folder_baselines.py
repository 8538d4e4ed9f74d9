"""Folders of sessions: what is listed, found, refused, recovered and written, in many states; compared with before."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest

from drivers.core.errors import InterruptionError
from sessions.recording import session_ids
from sessions.recording.listing import find_session, left_open, list_sessions, session_folder
from sessions.recording.manifest import Manifest, manifest_from, read_manifest, write_manifest
from sessions.recording.pacing import pace
from sessions.recording.recovery import recover
from sessions.recording.running_session import create_session
from sessions.recording.session import Session, new_folder
from sessions.recording.traffic.reader import TrafficMessage
from tests.support.baseline import assert_baseline
from tests.support.said import said

STARTED = datetime(2026, 11, 21, 9, 30, tzinfo=UTC)


def record(root: Path, minute: int, messages: int = 60, ends: Exception | None = None) -> Path:
    """A session of six seconds; it may end by an error."""
    joints = root / "joints.yaml"
    joints.parent.mkdir(exist_ok=True)
    joints.write_text("a: 1\n")
    started = STARTED.replace(minute=minute)
    session = create_session(
        root,
        rig="sim",
        rig_description={"a": 1},
        object_name="mesh:some/Blue Mug.stl",
        calibration_files={"hand joints": joints},
        started=started,
    )
    with suppress(Exception), session:
        for n in range(messages):
            session.recorder.on_received("hand", bytes([n]) * 20, 100_000_000 * n)
            session.recorder.on_received("ft/FF", bytes([n]), 100_000_000 * n + 1)
            session.settle()
        if ends is not None:
            raise ends
        session.close(counts={"grasps": 3}, data_loss={"undecodable hand": 2, "none": 0}, now=STARTED)
    return session.folder


@pytest.fixture
def root(tmp_path: Path) -> Path:
    folder = tmp_path / "runs"
    folder.mkdir()
    return folder


def told_of(folder: Path) -> dict[str, Any]:
    manifest = read_manifest(folder)
    content = manifest.model_dump()
    for key in ("versions", "calibration"):
        content.pop(key)
    content["derived"] = [[step["how"], step["source"]] for step in content["derived"]]
    content["ended_utc"] = content["ended_utc"] is not None
    return content


def test_manifests_of_sessions_that_ended_in_every_way(root: Path) -> None:
    endings: dict[str, Exception | None] = {
        "closed": None,
        "device": InterruptionError("stopped", where="hand", hint="Look"),
        "defect": ValueError("a number"),
        "silent": RuntimeError(),
        "memory": MemoryError(),
    }
    told = {name: told_of(record(root, n, 3, error)) for n, (name, error) in enumerate(endings.items())}
    with (
        pytest.raises(KeyboardInterrupt),
        create_session(root, rig="sim", rig_description={}, object_name="") as session,
    ):
        raise KeyboardInterrupt
    told["interrupted"] = [told_of(session.folder)["status"], session.folder.name[15:]]
    with pytest.raises(SystemExit), create_session(root, rig="a b", rig_description={}, object_name="ß") as session:
        raise SystemExit(3)
    told["ended"] = [told_of(session.folder)["problem"], session.folder.name[15:]]
    assert_baseline("sessions/folders/manifests", told)


def test_what_a_list_of_sessions_says(root: Path) -> None:
    told: dict[str, Any] = {"nothing": said(lambda: session_folder(root, "last"), root)}
    whole, torn, missing, opened, unreadable = (record(root, n, 8) for n in range(5))
    failed = record(root, 5, 2, ValueError("x"))
    (torn / "traffic.mcap").write_bytes((torn / "traffic.mcap").read_bytes()[:-5])
    (missing / "traffic.mcap").unlink()
    text = (opened / "session.yaml").read_text()
    (opened / "session.yaml").write_text(text.replace("status: closed", "status: open"))
    (unreadable / "session.yaml").write_text("status: [")
    (root / "no session").mkdir()
    (root / "a file").touch()
    told["list"] = [
        [
            item.name,
            item.status,
            item.grasps,
            item.data_loss,
            item.problem.replace(str(root), ""),
            item.readable,
            item.left_open,
            item.recorded_here,
        ]
        for item in list_sessions(root)
    ]
    told["sizes"] = [item.traffic_bytes > 0 for item in list_sessions(root)]
    told["left open"] = [item.name for item in left_open(root)]
    told["left open, none"] = [left_open(root / "none"), left_open(root / "a file")]
    names = (
        whole.name,
        str(whole),
        "last",
        "none",
        str(whole / "session.yaml"),
        str(root / "no session"),
        str(root / "a file"),
    )
    told["found"] = [said(lambda name=name: session_folder(root, name).name, root) for name in names]
    unreadable_later = unreadable.rename(root / "20261122-000000-later")
    told["hidden"] = said(lambda: session_folder(root, "last").name, root)
    shutil.rmtree(unreadable_later)
    told["last"] = said(lambda: find_session(root, "last").folder.name, root)
    whole.rename(root / "last")
    told["called last"] = said(lambda: session_folder(root, "last").name, root)
    told["no folder"] = said(lambda: list_sessions(root / "a file"), root)
    told["calibration"] = [
        said(lambda role=role: Session.open(failed).calibration_file(role).name, root)
        for role in ("hand joints", "none")
    ]
    (failed / "calibration" / "hand-joints.yaml").write_text("a: 2\n")
    told["changed"] = [
        said(lambda: Session.open(failed).calibration_file("hand joints").name, root),
        Session.open(failed).is_calibrated_as_recorded(),
    ]
    (failed / "traffic.mcap").unlink()
    told["changed, no copy"] = said(lambda: Session.open(failed).calibration_file("hand joints").name, root)
    assert_baseline("sessions/folders/list", told)


def test_recoveries_of_sessions_cut_off_anywhere(root: Path) -> None:
    source, told = record(root, 0), {}
    content, text = (source / "traffic.mcap").read_bytes(), (source / "session.yaml").read_text()
    (source / "results").mkdir(exist_ok=True)
    (source / "results" / "trajectory.csv").touch()
    (source / "notes").mkdir()
    (source / "notes" / "a.txt").write_text("kept")
    (source / "link").symlink_to(source / "notes")
    told["whole"] = _recovery(source, root)
    changes: dict[str, Callable[[], object]] = {
        "open": lambda: (source / "session.yaml").write_text(text.replace("status: closed", "status: open")),
        "no manifest": lambda: (source / "session.yaml").unlink(),
        "changed calibration": lambda: (source / "calibration" / "hand-joints.yaml").write_text("a: 3\n"),
        "torn end": lambda: (source / "traffic.mcap").write_bytes(content[:-5]),
        "almost nothing": lambda: (source / "traffic.mcap").write_bytes(content[:40]),
        "nothing": lambda: (source / "traffic.mcap").write_bytes(b""),
        "something else": lambda: (source / "traffic.mcap").write_bytes(b"no recording at all"),
    }
    for name, change in changes.items():
        (source / "session.yaml").write_text(text)
        (source / "calibration" / "hand-joints.yaml").write_text("a: 1\n")
        change()
        told[name] = _recovery(source, root)
    assert_baseline("sessions/folders/recovered", told)


def _recovery(source: Path, root: Path) -> Any:
    def act() -> Any:
        found = recover(source)
        topics = {
            topic: [*list(vars(each).values())[:3], round(each.last_s, 3)] for topic, each in found.topics.items()
        }
        if found.folder is None:
            return ["none", topics, found.describe(), found.lossy]
        files = sorted(path.relative_to(found.folder).as_posix() for path in found.folder.rglob("*") if path.is_file())
        told = told_of(found.folder)
        brief = [told[key] for key in ("name", "status", "counts", "data_loss", "problem", "derived")]
        return [topics, found.describe(), found.lossy, found.left_out, found.calibrations_lost, files, brief]

    said_of_it = said(act, root)
    for folder in root.glob("*-recovered*"):
        shutil.rmtree(folder)
    return said_of_it


def test_manifests_that_are_refused(root: Path) -> None:
    source = record(root, 0, 2)
    text, told = (source / "session.yaml").read_text(), {}
    for name, wrong in {
        "status": text.replace("status: closed", "status: lost"),
        "newer": text.replace("tactile-session/3", "tactile-session/4"),
        "key": text + "colour: blue\n",
        "list": "[1]",
        "torn": "status: [",
        "older": text.replace("tactile-session/3", "tactile-session/2").replace("derived: []\n", ""),
        "file": text.replace("hand-joints.yaml", "../joints.yaml"),
    }.items():
        (source / "session.yaml").write_text(wrong)
        told[name] = [
            said(lambda: read_manifest(source).status, root),
            said(lambda wrong=wrong: manifest_from(wrong.encode(), "a copy").status, root),
        ]
    shutil.rmtree(source / "calibration")
    told["no folder"] = said(lambda: read_manifest(root / "none").status, root)
    plain = Manifest(
        name="x", status="open", rig="1e3", rig_description={"t": "+1\n2"}, object_name="-", started_utc="2026"
    )
    write_manifest(root, plain)
    told["written"] = [
        line for line in (root / "session.yaml").read_text().splitlines() if not line.startswith(("versions", " "))
    ]
    steps = (*plain.derivation("piece", "a"), *plain.derivation("import", "b"))
    told["words"] = [step.words.partition(",")[0] for step in steps]
    assert_baseline("sessions/folders/refused", told)


def test_names_of_sessions(root: Path) -> None:
    names = ("a", "a_b-1", "A", "", "last", "x" * 64, "x" * 65, "ä", "a b")
    texts = ("Blue Mug", "mesh:some/part.v2.STL", "c:\\x\\y.ply", "  ", "ß", "--a--", "a.b.c")
    told = {
        "checked": [said(lambda name=name: session_ids.check_id(name, "here"), root) for name in names],
        "slugs": [session_ids.slug(text) for text in texts],
        "recovered": [session_ids.recovered_id(name) for name in ("a", "x" * 60)],
        "new": [
            new_folder(root, name).name
            for name in ("a", "a", "a", "y" * 70, "y" * 70, "z" * 61 + "-__", "z" * 61 + "-__")
        ],
    }
    (root / "file").touch()
    told["in a file"] = [said(lambda: new_folder(root / "file", "x"), root)]
    assert_baseline("sessions/folders/names", told)


class Stopwatch:
    """A clock that keeps until when it was told to wait."""

    def __init__(self) -> None:
        self.until: list[int] = []

    def now_ns(self) -> int:
        return 1_000

    def sleep_until_ns(self, deadline_ns: int) -> None:
        self.until.append(deadline_ns)


@pytest.mark.parametrize(("speed", "until"), [(0.0, []), (1.0, [1000, 1100, 900]), (4.0, [1000, 1025, 975])])
def test_messages_at_their_pace(speed: float, until: list[int]) -> None:
    messages = [TrafficMessage("/a", b"", stamp_ns, n) for n, stamp_ns in enumerate((500, 600, 400))]
    clock = Stopwatch()
    assert list(pace(messages, speed, clock)) == messages
    assert clock.until == until
