"""Who is at a session, by what was asked for on the command line."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Literal

from sessions.guided.operator import Operator
from sessions.guided.simulated_operator import SimulatedOperator
from tactile_lab.cli.guided_terminal import terminal_for
from tactile_lab.workflow.attending import Attendance


@dataclass(frozen=True)
class GuidedWay:
    """How a session is guided, as asked for.

    Attributes:
        led_by: how the hand is moved; None for what the rig says.
        automatic: captures come by themselves; None for what the rig says.
        pedal: a further key that captures.
        pace: simulated seconds for a real one.
        no_input: nobody is there: a simulated operator does what the prompts say.
    """

    led_by: Literal["keys", "hand"] | None
    automatic: bool | None
    pedal: str
    pace: float
    no_input: bool


@contextmanager
def attendance(way: GuidedWay | None) -> Iterator[Attendance]:
    """Who is there, for as long as the session runs; the terminal is as it was afterwards."""
    if way is None:
        yield Attendance()
    elif way.no_input:
        yield _guided(way, SimulatedOperator(), 0.0)
    else:
        with terminal_for(way.pedal) as terminal:
            yield _guided(way, terminal, way.pace)


def _guided(way: GuidedWay, operator: Operator, pace: float) -> Attendance:
    return Attendance(operator, guides=True, led_by=way.led_by, automatic=way.automatic, pace=pace)
