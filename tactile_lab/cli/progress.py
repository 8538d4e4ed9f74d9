"""The live table of a running session."""

from __future__ import annotations

import math
from types import TracebackType
from typing import Self

from rich.console import Group, RenderableType
from rich.live import Live
from rich.text import Text

from sessions.progress import GraspReport
from tactile_lab.cli.console import people, say, table
from tactile_lab.geometry.contacts import FINGERS

COLUMNS = ("grasp", "closing", *FINGERS, "contacts", "pose ±mm", "±deg", "explored", "verdict")


class LiveProgress:
    """A table that grows by a row a grasp; plain lines where standard error is no terminal."""

    def __init__(self, title: str) -> None:
        self._title, self._rows, self._phase = title, list[GraspReport](), "connecting"
        self._live = Live(self._view(), console=people, refresh_per_second=8) if people.is_terminal else None

    def __enter__(self) -> Self:
        if self._live is not None:
            self._live.start()
        else:
            say(self._title, "bold")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._phase = ""
        if self._live is not None:
            self._live.update(self._view())
            self._live.stop()

    def phase(self, number: int, name: str) -> None:
        """A grasp has come to a step of its cycle."""
        self._phase = f"grasp {number}: {name}"
        self._refresh()

    def grasp_done(self, report: GraspReport) -> None:
        """A grasp has been captured and estimated."""
        self._rows.append(report)
        self._refresh()
        if self._live is None:
            say("  ".join(f"{name} {cell}" for name, cell in zip(COLUMNS, _cells(report), strict=True) if cell))

    def told(self, message: str) -> None:
        """Something a person should know at once."""
        say(message, "yellow")

    def _refresh(self) -> None:
        if self._live is not None:
            self._live.update(self._view())

    def _view(self) -> RenderableType:
        numbers = range(2, len(COLUMNS) - 1)
        grid = table(self._title, COLUMNS, map(_cells, self._rows), right=(0, *numbers))
        grid.caption, grid.caption_justify = "forces in N", "left"
        return Group(grid, Text(self._phase, style="dim"))


def _cells(report: GraspReport) -> list[str]:
    forces = [f"{report.forces_N[finger]:.2f}" if finger in report.forces_N else "·" for finger in FINGERS]
    position_mm = None if report.position_sigma_m is None else 1e3 * report.position_sigma_m
    yaw_deg = None if report.yaw_sigma_rad is None else math.degrees(report.yaw_sigma_rad)
    explored = "" if report.explored is None else f"{report.explored:.0%}"
    shown = [_number(position_mm), _number(yaw_deg), explored, report.verdict]
    return [f"{report.number}/{report.planned}", report.closing, *forces, str(report.contacts), *shown]


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.1f}"
