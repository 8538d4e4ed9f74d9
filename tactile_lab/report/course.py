"""What a recording tells of the course of a session: the exploration policy's decisions, and why everything stopped."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from drivers.core.clock import NANOSECONDS
from drivers.core.errors import SessionError
from sessions.recording.session import TRAFFIC, Session
from sessions.recording.traffic.reader import TrafficMessage, may_hold
from sessions.recording.traffic.schemas import DECISION_TOPIC, SAFETY_TOPIC

Read = TypeVar("Read")


@dataclass(frozen=True)
class ChosenGrasp:
    """Where the hand was sent, world frame, how it was to close, and what the policy gave for it (None: nothing)."""

    x_m: float
    y_m: float
    yaw_rad: float
    closing: str
    score: float | None


@dataclass(frozen=True)
class PolicyDecision:
    """What the policy decided about one grasp.

    Attributes:
        number: of the grasp, from 1.
        policy: its name.
        outcome: grasp, stop or nothing.
        reason: in a sentence.
        chosen: the grasp; None where none was chosen.
        promised_gain: what it expects of it, in its own unit; None where it does not say.
        candidates: how many could be used.
        vetoed: how many of them a person refused.
        ruled_out: how many could not be used, by obstacle.
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
    """Everything was stopped: when on the session's clock (s), and why."""

    time_s: float
    cause: str


@dataclass(frozen=True)
class Course:
    """Decisions in the order of the grasps, stops in that of time."""

    decisions: tuple[PolicyDecision, ...] = ()
    stops: tuple[Stop, ...] = ()


def read_course(session: Session) -> Course:
    """The course of a session; where a grasp was decided about anew, the last decision counts.

    Nothing is told of a session whose recording is kept elsewhere.

    Raises:
        SessionError: the recording cannot be read, or a message in it is of another form.
    """
    path = session.folder / TRAFFIC
    if not path.is_file() or not may_hold(path, (DECISION_TOPIC, SAFETY_TOPIC)):
        return Course()
    decisions: list[PolicyDecision] = []
    stops: list[Stop] = []
    for message in session.traffic().messages():
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
        raise SessionError(f"a message of {message.topic} is of another form ({error!r})", where=str(path)) from error


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
