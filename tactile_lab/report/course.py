"""The course of a session from its recording: the exploration policy's decisions, and the reasons of stops."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from drivers.core.clock import NANOSECONDS
from drivers.core.errors import SessionDataError
from sessions.recording.session import TRAFFIC, Session
from sessions.recording.traffic.reader import TrafficMessage, may_hold
from sessions.recording.traffic.schemas import DECISION_TOPIC, SAFETY_TOPIC

Read = TypeVar("Read")


@dataclass(frozen=True)
class ChosenGrasp:
    """Target of the hand in the world frame, its closing, and the policy's score (None: no score)."""

    x_m: float
    y_m: float
    yaw_rad: float
    closing: str
    score: float | None


@dataclass(frozen=True)
class PolicyDecision:
    """The policy's decision about one grasp.

    Attributes:
        number: of the grasp, from 1.
        policy: its name.
        outcome: grasp, stop or nothing.
        reason: as a sentence.
        chosen: the grasp; None if none was chosen.
        promised_gain: expected gain in the policy's own unit; None if it has none.
        candidates: number of feasible candidates.
        vetoed: number vetoed by a person.
        ruled_out: number of infeasible candidates, by obstacle.
    """

    number: int
    policy: str
    outcome: str
    reason: str
    chosen: ChosenGrasp | None
    promised_gain: float | None
    candidates: int
    vetoed: int
    ruled_out: Mapping[str, int]


@dataclass(frozen=True)
class Stop:
    """A stop: its time on the session's clock (s), and its reason."""

    time_s: float
    cause: str


@dataclass(frozen=True)
class Course:
    """Decisions in the order of the grasps, stops in order of time."""

    decisions: tuple[PolicyDecision, ...] = ()
    stops: tuple[Stop, ...] = ()


def read_course(session: Session) -> Course:
    """The course of a session; of several decisions about a grasp the last one counts.

    Empty for a session without its recording.

    Raises:
        SessionError: the recording cannot be read, or a message in it has another format.
    """
    path = session.folder / TRAFFIC
    if not path.is_file() or not may_hold(path, (DECISION_TOPIC, SAFETY_TOPIC)):
        return Course()
    decisions: list[PolicyDecision] = []
    stops: list[Stop] = []
    for message in session.traffic().messages_on({DECISION_TOPIC, SAFETY_TOPIC}):
        if message.topic == DECISION_TOPIC:
            newest = _read(message, path, _decision)
            decisions = [*(one for one in decisions if one.number < newest.number), newest]
        elif message.topic == SAFETY_TOPIC:
            stops.append(_read(message, path, _stop))
    return Course(tuple(decisions), tuple(stops))


def _read(message: TrafficMessage, path: Path, form: Callable[[dict[str, Any], int], Read]) -> Read:
    try:
        return form(json.loads(message.data), message.stamp_ns)
    except (ValueError, KeyError, TypeError, IndexError, AttributeError) as error:
        what = f"a message on {message.topic} does not have the form of its topic"
        raise SessionDataError(what, where=str(path), hint="Was it written by another program?") from error


def _decision(content: dict[str, Any], stamp_ns: int) -> PolicyDecision:
    chosen, gain = content["chosen"], content["promised_gain"]
    return PolicyDecision(
        number=int(content["number"]),
        policy=str(content["policy"]),
        outcome=str(content["outcome"]),
        reason=str(content["reason"]),
        chosen=None if chosen is None else _candidate(content["candidates"][chosen]),
        promised_gain=None if gain is None else float(gain),
        candidates=len(content["candidates"]),
        vetoed=len(content["vetoed"]),
        ruled_out={str(obstacle): int(count) for obstacle, count in content["ruled_out"].items()},
    )


def _candidate(content: dict[str, Any]) -> ChosenGrasp:
    score = content["score"]
    return ChosenGrasp(
        x_m=float(content["x_m"]),
        y_m=float(content["y_m"]),
        yaw_rad=float(content["yaw_rad"]),
        closing=str(content["closing"]),
        score=None if score is None else float(score),
    )


def _stop(content: dict[str, Any], stamp_ns: int) -> Stop:
    return Stop(stamp_ns / NANOSECONDS, str(content["cause"]))
