"""Terminal display of a guided session: a panel below the list of grasps, or plain lines."""

from __future__ import annotations

from rich.console import Group, RenderableType
from rich.panel import Panel as Frame
from rich.table import Table
from rich.text import Text

from drivers.core.contacts import FINGERS
from sessions.guided.operator import Panel, Stage

STEPS = (Stage.FEEL, Stage.PLACE, Stage.GUIDE, Stage.CLOSE, Stage.HOLD, Stage.CAPTURE, Stage.ROTATE, Stage.RELEASE)
KEYS = "SPACE next · g go · u undo · x give up · p pause · e end · a automatic · n note · m marker"
_BAR_N, _BAR_WIDTH = 1.0, 4  # five fingers fit beside one another in 80 columns
_FORCE_WIDTH = _BAR_WIDTH + len(" 0.00 N")
_SAID = {Stage.PLACE: ("object", "suggested"), Stage.HOLD: ("stability", "observability")}
"""Facts that plain lines show at a step, besides the contacts."""


def as_panel(panel: Panel, typing: str = "") -> RenderableType:
    """The panel as a frame; ``typing`` is the text being typed."""
    rows: list[RenderableType] = [_steps(panel.stage), Text(panel.prompt, style="bold"), Text(), _forces(panel)]
    rows += [_fact(name, value) for name, value in facts(panel)]
    rows.append(Text())
    rows.append(Text(f"{typing}▏", style="bold") if typing else Text(KEYS, style="dim"))
    title = f"grasp {panel.grasp}" + (" · PAUSED" if panel.paused else "")
    style = "yellow" if panel.paused or panel.view.silent else "cyan"
    return Frame(Group(*rows), title=title, title_align="left", border_style=style, width=100)


def facts(panel: Panel) -> list[tuple[str, str]]:
    """Current readings and facts by name, without empty ones."""
    seen = panel.view
    told = [
        ("paused", panel.paused),
        ("contacts", seen.words()),
        ("silent", ", ".join(seen.silent)),
        ("stability", panel.capture or f"steady for {seen.steady_s:.1f} s"),
        ("observability", "" if seen.observability is None else f"{seen.observability:.2f} of the current grasp"),
        ("object", panel.unknown),
        ("suggested", panel.suggestion),
        ("capture", "automatic when contacts are steady" if panel.automatic else "on a key"),
        ("last", panel.message),
    ]
    return [(name, value) for name, value in told if value]


def as_lines(panel: Panel) -> list[str]:
    """The same as plain lines: the prompt, the readings, and the facts that matter at this step."""
    told, names = dict(facts(panel)), _SAID.get(panel.stage, ())
    said = [f"  {name}: {told[name]}" for name in names if name in told]
    return [f"[{panel.grasp} {panel.stage}] {panel.prompt}", f"  {panel.view.words()}", *said]


def _steps(stage: Stage) -> Text:
    text = Text()
    for step in STEPS:
        text.append(f" {step.value} ", style="reverse bold" if step is stage else "dim")
    return text


def _fact(name: str, value: str) -> Text:
    style = "yellow" if name in ("paused", "silent") else ""
    return Text.assemble((f"{name:>14}  ", "dim"), (value, style), no_wrap=True, overflow="ellipsis")


def _forces(panel: Panel) -> RenderableType:
    grid = Table.grid(padding=(0, 1))
    cells = []
    for finger in [finger for finger in FINGERS if finger in panel.view.forces_N] or FINGERS:
        grid.add_column(no_wrap=True)
        cells.append(_force(finger, panel))
    grid.add_row(*cells)
    return grid


def _force(finger: str, panel: Panel) -> Text:
    force_N, touches = panel.view.forces_N.get(finger), finger in panel.view.touching
    if finger in panel.view.silent:
        return Text(f"{finger} {'no reading':<{_FORCE_WIDTH}}", style="yellow")
    if force_N is None:
        return Text(f"{finger} {'not zeroed':<{_FORCE_WIDTH}}", style="dim")
    filled = min(_BAR_WIDTH, round(_BAR_WIDTH * force_N / _BAR_N))
    bar = "#" * filled + "." * (_BAR_WIDTH - filled)
    return Text(f"{finger} {bar} {force_N:4.2f} N", style="green" if touches else "dim")
