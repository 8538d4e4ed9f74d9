"""The panel of the page: what to do, sensor readings, the grasps so far, and buttons."""

from __future__ import annotations

import html
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import viser
from viser import Icon, IconName

from drivers.core.contacts import FINGERS
from sessions.guided.operator import Ask
from tactile_lab.colours import SIGMA_FULL_m, hex_colour, viridis
from tactile_lab.view.plots import Plots
from tactile_lab.view.scene import Scene

Press = Callable[[Ask, str], None]
"""Called with the request of a pressed button and a text."""

BUTTONS: tuple[tuple[Ask, str, IconName, str], ...] = (
    (Ask.NEXT, "Next step", Icon.PLAYER_SKIP_FORWARD, "Finish this step"),
    (Ask.GO, "Do it", Icon.ROBOT, "Let the rig do this step automatically"),
    (Ask.CAPTURE, "Capture", Icon.FOCUS_CENTERED, "Measure this grasp now"),
    (Ask.UNDO, "Undo", Icon.ARROW_BACK_UP, "Undo the last grasp"),
    (Ask.PAUSE, "Pause / resume", Icon.PLAYER_PAUSE, "Pause all motion until pressed again"),
    (Ask.END, "End", Icon.PLAYER_STOP, "End the session; press twice"),
)
GREY, GREEN, AMBER, RED = (73, 80, 87), (26, 127, 55), (138, 90, 0), (200, 34, 44)
"""Of buttons: white words on them have a contrast of five to one and more."""

_BUTTON_COLOURS = {Ask.END: RED, Ask.PAUSE: AMBER, Ask.CAPTURE: GREEN}
_ROWS = 8
_MOST_TOLD = 3
"""Doubts and alternatives that the panel has room for; the report has all."""

_STATUS_COLOURS = {"complete": "#1a7f37", "partial": "#57606a", "ambiguous": "#9a6700", "lost": "#cf222e"}
_SHOWN_s = 8.0
PANEL_STYLE = "padding:0 0.9em 0.6em 0.9em;font-size:0.85em;line-height:1.45"


class Controls:
    """Draws the panel: what to do and how it stands, the buttons, and what is known besides.

    Args:
        server: the page.
        press: called with a button's request and a text.
        live: whether a session accepts requests.
    """

    def __init__(self, server: viser.ViserServer, press: Press, *, live: bool) -> None:
        self._status = server.gui.add_html("")
        if live:
            for ask, label, icon, hint in BUTTONS:
                self._button(server, ask, label, icon, hint, press)
            self._note(server, press)
        self._details = server.gui.add_html("")
        self._history = server.gui.add_html("")
        self._plots = Plots(server)

    def _button(
        self,
        server: viser.ViserServer,
        ask: Ask,
        label: str,
        icon: IconName,
        hint: str,
        press: Press,
    ) -> None:
        button = server.gui.add_button(label, hint=hint, icon=icon, color=_BUTTON_COLOURS.get(ask, GREY))
        button.on_click(lambda event: press(ask, ""))

    def _note(self, server: viser.ViserServer, press: Press) -> None:
        text: Any = server.gui.add_text("Note", "")
        button = server.gui.add_button("Save note", icon=Icon.PENCIL, color=GREY)

        def keep(event: viser.GuiEvent[Any]) -> None:
            note, text.value = text.value, ""
            if note.strip():
                press(Ask.NOTE, note)
            elif event.client is not None:  # a browser that is behind sends the press and drops what was written
                said = "The note is empty, or was not received. Write it and press again."
                event.client.add_notification("Note not saved", said, auto_close_seconds=_SHOWN_s, color="red")

        button.on_click(keep)

    def draw(self, scene: Scene) -> None:
        """Update the panel."""
        self._status.content = status_html(scene)
        self._details.content = details_html(scene)
        self._history.content = history_html(scene)
        self._plots.draw(scene)


def status_html(scene: Scene) -> str:
    """What to do and how it stands, in a few lines, so that the buttons below are in sight on a small screen too."""
    guide, parts = scene.guide, []
    if guide.get("paused"):
        parts.append(banner(f"Paused: {guide['paused']}", "#8a5a00"))
    if guide:
        parts.append(line_html(f"Grasp {guide.get('grasp', '')}: {guide.get('stage', '')}", "font-weight:600"))
        parts.append(line_html(str(guide.get("prompt", "")), "font-size:1.15em;font-weight:600;color:#1f6feb"))
        parts.append(line_html(str(guide.get("capture", "")), "color:#57606a;margin-bottom:0.4em"))
    return _panel([*parts, _trust(scene), forces_html(scene)])


def details_html(scene: Scene) -> str:
    """Why the estimate is doubted, what else it may be, and what is known of the session."""
    guide = scene.guide
    facts = [
        ("pose", _pose(scene)),
        ("explored", "" if scene.surface is None else f"{scene.surface.explored:.0%} of the surface is known"),
        ("object", str(guide.get("unknown", ""))),
        ("next", str(guide.get("suggestion", "") or scene.next_plan.get("reason", ""))),
        ("last", scene.messages[-1] if scene.messages else ""),
        ("not shown", f"{scene.dropped} messages: the page was slower than the session" if scene.dropped else ""),
    ]
    told = [_fact(name, value) for name, value in facts if value]
    return _panel([*_reasons(scene), *told, "" if scene.surface is None else _scale()])


def _panel(parts: list[str]) -> str:
    return f'<div style="{PANEL_STYLE}">{"".join(parts)}</div>'


def _trust(scene: Scene) -> str:
    """How far to trust the estimate; empty if unknown."""
    told = scene.trust
    if not told:
        return ""
    status, share = str(told.get("status", "")), told.get("known_share")
    touched = "" if share is None else f", {share:.0%} of the shape touched"
    return banner(f"{status.capitalize()}{touched}", _STATUS_COLOURS.get(status, "#57606a"))


def _reasons(scene: Scene) -> list[str]:
    """Each doubt and each alternative on a line."""
    told = scene.trust
    doubts = [line_html(f"• {words}", "") for words in told.get("doubts", [])[:_MOST_TOLD]]
    return [
        *doubts,
        *(line_html(f"or {words}", "color:#57606a") for words in told.get("alternatives", [])[:_MOST_TOLD]),
    ]


def forces_html(scene: Scene) -> str:
    """A bar for the force on each fingertip."""
    cells = []
    for finger in [finger for finger in FINGERS if finger in scene.loads_N] or FINGERS:
        load_N = scene.loads_N.get(finger, 0.0)
        share = 0.0 if load_N is None else min(1.0, load_N / 1.5)
        colour = "#f0aa1e" if load_N is None else "#2ea043" if load_N > 0.1 else "#969eaa"
        text = "silent" if load_N is None else f"{load_N:.2f} N"
        cells.append(
            f'<div style="flex:1 0 4.4em"><div style="height:6px;background:#e5e8ec;border-radius:3px">'
            f'<div style="height:6px;width:{100 * share:.0f}%;background:{colour};border-radius:3px"></div></div>'
            f'<div style="white-space:nowrap">{finger} {text}</div></div>'
        )
    return f'<div style="display:flex;flex-wrap:wrap;gap:6px;margin:0.5em 0;font-size:0.85em">{"".join(cells)}</div>'


def _pose(scene: Scene) -> str:
    if scene.world_T_object is None:
        return "not known yet"
    pose = scene.world_T_object
    text = f"{1e3 * pose.x():.0f}, {1e3 * pose.y():.0f} mm, {math.degrees(pose.rotation().yaw()):.0f}°"
    if scene.covariance is None:
        return text
    position_mm = 1e3 * math.sqrt(float(np.trace(scene.covariance[:2, :2])) / 2)
    return f"{text} (± {position_mm:.1f} mm, {math.degrees(math.sqrt(float(scene.covariance[2, 2]))):.1f}°)"


def history_html(scene: Scene) -> str:
    """A row for each of the newest grasps."""
    rows = []
    for grasp in scene.grasps[-_ROWS:][::-1]:
        step = scene.steps.get(grasp.index, {})
        said = html.escape(f"{step.get('verdict', '')}: {step.get('reason', '')}" if step else "")
        rows.append(f"<tr><td>{grasp.index + 1}</td><td>{len(grasp.fingers)}</td><td>{said}</td></tr>")
    if not rows:
        return f'<div style="{PANEL_STYLE}">no grasp yet</div>'
    head = '<tr style="text-align:left;color:#57606a"><th>grasp</th><th>contacts</th><th>estimate</th></tr>'
    return f'<div style="{PANEL_STYLE}"><table style="width:100%">{head}{"".join(rows)}</table></div>'


def _scale() -> str:
    """Legend of the surface's colours."""
    colours = ",".join(hex_colour(colour) for colour in viridis(np.linspace(0.0, 1.0, 6)))
    bar = f'<span style="flex:1;height:8px;border-radius:4px;background:linear-gradient(90deg,{colours})"></span>'
    return (
        '<div style="display:flex;align-items:center;gap:6px;color:#57606a;margin-top:0.4em">'
        f"<span>surface ± 0</span>{bar}<span>{1e3 * SIGMA_FULL_m:.0f} mm or more</span></div>"
    )


def line_html(text: str, style: str) -> str:
    """A line of styled text; empty for no text."""
    return f'<div style="{style}">{html.escape(text)}</div>' if text else ""


def banner(text: str, colour: str) -> str:
    """White text on a colour."""
    style = f"background:{colour};color:white;border-radius:4px;padding:0.3em 0.6em;margin-bottom:0.4em;font-weight:600"
    return line_html(text, style)


def _fact(name: str, value: str) -> str:
    label = f'<span style="color:#57606a;flex:none;width:5em">{html.escape(name)}</span>'
    return f'<div style="display:flex">{label}<span>{html.escape(value)}</span></div>'
