"""One short session on the simulated rig, physics and all: everything it records and tells, compared with before.

It taps nothing, weighs the box once, carries it once and grasps it twice. Whatever changes in how the hand moves, what
is understood of the bytes, or what is written, shows here, though not why: other tests say that.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from typing import Any

import pytest

from drivers.core.clock import VirtualClock
from drivers.core.contacts import Grasp
from sessions.conductor.progress import GraspReport, NullProgress
from sessions.conductor.session_outcome import SessionOutcome
from sessions.exchange.sample_tables import read_tables
from sessions.perception.replay import Replay, kept_grasps
from sessions.perception.replay_rig import recorded_links
from sessions.recording.listing import summarize
from sessions.recording.session import Session
from sessions.recording.traffic import schemas
from tactile_lab.rigs.build import build_interpreter
from tactile_lab.rigs.description import rig_of_session
from tactile_lab.workflow.running import SessionRequest, run_session
from tests.support.baseline import assert_baseline
from tests.support.digest import digest_records
from tests.support.low_rig import low_rig

CLOSE = {"rtol": 1e-5, "atol": 1e-7}
"""Another processor's rounding moves contacts by less than a nanometre."""


class Heard(NullProgress):
    """Keeps what a person is told."""

    def __init__(self) -> None:
        self.phases: list[str] = []
        self.reports: list[GraspReport] = []
        self.messages: list[str] = []

    def phase(self, number: int, name: str) -> None:
        self.phases.append(f"{number} {name}")

    def grasp_done(self, report: GraspReport) -> None:
        self.reports.append(report)

    def on_message(self, message: str) -> None:
        self.messages.append(message)


@dataclass(frozen=True)
class Recorded:
    """A session that has ended."""

    session: Session
    outcome: SessionOutcome
    heard: Heard


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    folder, heard = tmp_path_factory.mktemp("whole"), Heard()
    wanted = {"weighings": 1, "exploration": {"policy": None}}
    rig = low_rig(folder, {"conductor": wanted, "simulation": {"object_mass_kg": 0.15}})
    request = SessionRequest(str(rig), "box-10x6x4", folder / "sessions", method="odometry", seed=3, grasps=2)
    finished = run_session(request, heard)
    assert finished.outcome is not None
    return Recorded(Session.open(finished.folder), finished.outcome, heard)


def test_what_a_person_is_told(recorded: Recorded) -> None:
    heard = recorded.heard
    reports = [asdict(report) for report in heard.reports]
    assert_baseline(
        "sessions/whole/told", {"phases": heard.phases, "messages": heard.messages, "reports": reports}, **CLOSE
    )


def test_grasps_and_what_was_learned_of_the_object(recorded: Recorded) -> None:
    outcome = recorded.outcome
    properties = outcome.properties
    assert_baseline(
        "sessions/whole/grasps",
        {
            "ending": f"{outcome.ending}: {outcome.reason}",
            "dropped": outcome.dropped,
            "grasps": [told(grasp) for grasp in outcome.grasps],
            "hangings": [[index, vars(each)] for index, each in properties.hangings],
            "draggings": [[index, vars(each)] for index, each in properties.draggings],
            "sliding": digest_records(each for _, each in properties.sliding),
            "words": properties.in_words(),
        },
        **CLOSE,
    )


def told(grasp: Grasp) -> dict[str, Any]:
    """A grasp as plain data."""
    return {
        "stamp_ns": grasp.stamp_ns,
        "contacts": [vars(contact) for contact in grasp.contacts],
        "palm": grasp.world_T_palm.matrix()[:3],
        "motion": grasp.hand_motion_world.matrix()[:3],
        "sigma": None if grasp.motion_sigma is None else vars(grasp.motion_sigma),
        "paths": [vars(path) for path in grasp.approach_paths],
    }


def test_every_topic_of_the_recording(recorded: Recorded) -> None:
    content: dict[str, list[Any]] = {}
    for message in recorded.session.traffic().messages():
        told = {"stamp_ns": message.stamp_ns, "size": len(message.data)}
        if schemas.is_raw(message.topic):
            device = message.device
            told |= {"counter": device.counter, "clock": device.clock_ns, "readings": device.readings}
        elif message.topic != schemas.IMAGE_TOPIC:
            told = {"stamp_ns": message.stamp_ns, "content": without_time_of_day(json.loads(message.data))}
        content.setdefault(message.topic, []).append(told)
    assert_baseline(
        "sessions/whole/topics", {topic: digest_records(content[topic]) for topic in sorted(content)}, **CLOSE
    )


def without_time_of_day(content: dict[str, Any]) -> dict[str, Any]:
    """Without what differs from run to run."""
    return {key: value for key, value in content.items() if key not in ("seconds", "data")}


def test_its_manifest_and_how_it_is_listed(recorded: Recorded) -> None:
    manifest = recorded.session.manifest
    content = {
        key: getattr(manifest, key)
        for key in ("format", "status", "object_name", "seeds", "notes", "counts", "streams", "data_loss", "problem")
    }
    content["calibration"] = sorted(manifest.calibration)
    listed = summarize(recorded.session.folder)
    told = {
        "manifest": content,
        "listed": [listed.status, listed.grasps, listed.data_loss, listed.problem, listed.derived],
    }
    assert_baseline("sessions/whole/manifest", told)


def test_it_is_understood_again_and_as_tables(recorded: Recorded) -> None:
    session = recorded.session
    rig = rig_of_session(session)
    replay = Replay(session, build_interpreter(rig), clock=VirtualClock())
    outcomes = list(replay.outcomes())
    assert [told(grasp) for grasp in kept_grasps(outcomes)].__repr__() == [
        told(grasp) for grasp in recorded.outcome.grasps
    ].__repr__()
    tables = read_tables(session.traffic(), build_interpreter(rig))
    content = {
        name: [
            table.columns,
            len(table.rows),
            table.stamps_ns[:: len(table.rows) // 3 + 1],
            digest_records(table.rows[::50]),
        ]
        for name, table in tables.tables.items()
    }
    kinds = [type(outcome).__name__ for outcome in outcomes]
    assert_baseline("sessions/whole/again", {"kinds": kinds, "loss": replay.loss.counts(), "tables": content}, **CLOSE)


def test_its_links_are_played_to_devices_when_they_are_due(recorded: Recorded) -> None:
    clock = VirtualClock()
    links = recorded_links(recorded.session.traffic(), clock, speed=2.0)
    due: dict[str, list[int]] = {name: [] for name in links}
    for _ in range(20):
        for name, link in links.items():
            due[name].append(len(link.receive()))
        clock.sleep_until_ns(clock.now_ns() + 50_000_000)
    links["hand"].send(b"something else")
    assert_baseline("sessions/whole/links", {"due": due, "as then": [link.as_then for link in links.values()]})
