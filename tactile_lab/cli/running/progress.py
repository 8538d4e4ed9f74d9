"""Display of a running session: one line per grasp, and on a terminal the current step."""

from __future__ import annotations

import math
from types import TracebackType
from typing import Self

from rich.live import Live
from rich.text import Text

from drivers.core.contacts import FINGERS
from sessions.conductor.progress import GraspReport
from tactile_lab.cli.console import people, say

HEAD = ("grasp", "closing", *FINGERS, "±mm", "±deg", "known", "verdict")
WIDTHS = (6, -8, *([6] * len(FINGERS)), 6, 6, 7, -1)
"""Column widths in characters; negative for left-aligned text."""
INTERRUPTED = "Ctrl+C: finishing this grasp, then closing the session. Press again to stop immediately"
LEGEND = "fingertip forces in N (in brackets of a touch alone), uncertainty of the pose, share of the surface known"


class LiveProgress:
    """Shows the events of a session to people.

    Each grasp is a permanent line, in a terminal or a file; the current step is a temporary line below them on a
    terminal.

    Args:
        title: title of the session.
        live: show the current step; a guided session shows it itself.
        reasons: show below each grasp why it was chosen.
    """

    def __init__(self, title: str, *, live: bool = True, reasons: bool = False) -> None:
        self._title, self._begun, self._listed, self._reasons = title, False, False, reasons
        self._now, self._is_interrupted, self._interruption_told = Text(""), False, False
        live = live and people.is_terminal
        shown = Live(console=people, refresh_per_second=8, transient=True, get_renderable=self._render)
        self._live = shown if live else None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._live is not None:
            self._live.stop()

    def phase(self, number: int, name: str) -> None:
        """A grasp has reached a step of its cycle."""
        if not self._begun:
            self._begun = True
            say(self._title, "bold")
            if self._live is not None:
                self._live.start()
        self._now = Text(f"grasp {number}: {name}" if number else name, style="dim")
        if self._is_interrupted and not self._interruption_told:
            self._interruption_told = True
            self.on_message(INTERRUPTED)

    def grasp_done(self, report: GraspReport) -> None:
        """A grasp has been captured and estimated."""
        if not self._listed:
            self._listed = True
            say(LEGEND, "dim")
            _line(HEAD, "bold")
        _line(_cells(report))
        if self._reasons:
            say(f"        {report.reason}", "dim")

    def on_message(self, message: str) -> None:
        """Something a person should know immediately."""
        say(message, "yellow")

    def on_interrupt(self) -> None:
        """Ctrl+C was pressed: the current step's line says so immediately, and a permanent line follows at the next
        step.
        """
        self._is_interrupted = True

    def _render(self) -> Text:
        """The current step."""
        told_here = self._is_interrupted and not self._interruption_told
        return Text(INTERRUPTED, style="yellow") if told_here else self._now


def _line(cells: tuple[str, ...], style: str = "") -> None:
    """A row of the table; on a terminal the verdict is cut off at the end of the line."""
    columns = zip(cells, WIDTHS, strict=True)
    padded = [cell.rjust(width) if width > 0 else "  " + cell.ljust(-width) for cell, width in columns]
    text = Text("".join(padded).rstrip(), style=style)
    if people.is_terminal:
        people.print(text, no_wrap=True, overflow="ellipsis")
    else:
        people.print(text, soft_wrap=True)


def _cells(report: GraspReport) -> tuple[str, ...]:
    forces = [_force(report, finger) for finger in FINGERS]
    position_mm = None if report.position_sigma_m is None else 1e3 * report.position_sigma_m
    yaw_deg = None if report.yaw_sigma_rad is None else math.degrees(report.yaw_sigma_rad)
    explored = "" if report.explored is None else f"{report.explored:.0%}"
    number = f"{report.number}/{report.planned}"
    return (number, report.closing, *forces, _number(position_mm), _number(yaw_deg), explored, report.verdict)


def _force(report: GraspReport, finger: str) -> str:
    if finger in report.forces_N:
        return f"{report.forces_N[finger]:.2f}"
    return f"({report.touches_N[finger]:.1f})" if finger in report.touches_N else "·"


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.1f}"
