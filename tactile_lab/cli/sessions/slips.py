"""``tactile-lab session slips``: how far objects slip relative to the hand, from recorded sessions."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tactile_lab.cli.options import Json, NoInput, Root
from tactile_lab.cli.sessions.choosing import choose_session

if TYPE_CHECKING:
    from drivers.core.contacts import Array
    from sessions.recording.session import Session
    from tactile_lab.evaluation.slips import Slips
    from tactile_lab.slam.tracking.contacts.motion import MotionNoise


def slips(
    sessions: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="SESSION...",
            help="Sessions of one rig: folders, or names under --root.",
            show_default="all closed sessions",
        ),
    ] = None,
    root: Root = Path("runs"),
    as_json: Json = False,
    no_input: NoInput = False,
) -> None:
    """Measure with the marker camera how far objects slip, and print matching 'motion' settings for the rig file.

    A slip is the object's motion between two grasps relative to the hand's motion.
    """
    from drivers.core.errors import SessionDataError
    from tactile_lab.cli.console import emit_json
    from tactile_lab.evaluation.slips import Slips

    del no_input
    measured = _measure(_choose_sessions(root, sessions))
    told = [name for name, found in measured.items() if len(found.carried) + len(found.left)]
    if not told:
        hint = "Slips need a marker camera that sees the object at two grasps in a row"
        raise SessionDataError("slips cannot be measured in any of the sessions", where=str(root), hint=hint)
    found = Slips.join(measured.values())
    if as_json:
        emit_json(_document(found, told))
    else:
        _show(found, told)


def _choose_sessions(root: Path, names: list[str] | None) -> list[Session]:
    """The given sessions, or all closed ones; of one rig."""
    from drivers.core.errors import ConfigurationError
    from sessions.recording.listing import list_sessions
    from sessions.recording.session import Session

    if names:
        found = [choose_session(root, name) for name in names]
    else:
        found = [Session.open(each.folder) for each in list_sessions(root) if each.status == "closed"]
    if not found:
        raise ConfigurationError("contains no closed session", where=str(root), hint="Record one with: tactile-lab run")
    rigs = sorted({session.manifest.rig for session in found})
    if len(rigs) > 1:
        hint = "Give sessions of one rig, or keep each rig's sessions in a separate folder (--root)"
        raise ConfigurationError(f"sessions of several rigs: {', '.join(rigs)}", where=str(root), hint=hint)
    return found


def _measure(sessions: list[Session]) -> dict[str, Slips]:
    """Slips of each session by its name; unusable sessions are skipped with a warning if there are others."""
    from drivers.core.errors import TactileLabError
    from tactile_lab.cli.console import warn
    from tactile_lab.workflow.measuring_slips import session_slips

    found: dict[str, Slips] = {}
    for session in sessions:
        try:
            found[session.manifest.name] = session_slips(session)
        except TactileLabError as error:
            if len(sessions) == 1:
                raise
            warn(f"{session.manifest.name} is skipped: {error}")
    return found


def _show(found: Slips, sessions: list[str]) -> None:
    from tactile_lab.cli.console import answer, count, say, show_table
    from tactile_lab.evaluation.slips import LEAST_STEPS

    titles = ["the object was", "steps", "mm, rms", "mm", "°, rms", "°"]
    rows = [
        _row("carried", found.carried),
        _row("left in place", found.left),
        _row("carried, as felt", found.felt.missed),
    ]
    title = f"Slips in {count(len(sessions), 'session')} (rms per axis; median / p90 / maximum)"
    show_table(title, titles, rows, right=(1, 2, 3, 4, 5))
    if len(found.felt.missed):
        answer(found.felt.in_words())
    motion = found.motion
    if motion is None:
        carried = count(len(found.carried), "step")
        say(
            f"the object was carried in {carried}; at least {LEAST_STEPS} are needed to estimate the rig's "
            "motion settings",
            "yellow",
        )
        return
    if len(found.left) >= LEAST_STEPS:
        answer(f"pushed by the closing hand although left in place: {found.pushed_count(motion)} of {len(found.left)}")
    answer("for the rig file:", "bold")
    for line in ("motion:", *(f"  {name}: {value}" for name, value in _settings(motion).items())):
        answer(line)


def _row(name: str, slips: Array) -> tuple[str, ...]:
    import numpy as np

    from tactile_lab.evaluation.slips import lengths_m, root_mean_squares
    from tactile_lab.evaluation.spread import Spread

    if not len(slips):
        return name, "0", "", "", "", ""
    per_axis_m, turn_rad = root_mean_squares(slips)
    far, turned = Spread.of(list(1e3 * lengths_m(slips))), Spread.of(list(np.rad2deg(np.abs(slips[:, 2]))))
    return name, str(len(slips)), f"{1e3 * per_axis_m:.1f}", far.text(), f"{np.rad2deg(turn_rad):.1f}", turned.text()


def _settings(motion: MotionNoise) -> dict[str, float]:
    """In plain notation."""
    return {name: float(f"{value:.2g}") for name, value in motion.model_dump().items()}


def _document(found: Slips, sessions: list[str]) -> dict[str, Any]:
    motion = found.motion
    return {
        "sessions": sessions,
        "carried": found.carried.tolist(),
        "left": found.left.tolist(),
        "felt": {"missed": found.felt.missed.tolist(), "sigmas": found.felt.sigmas.tolist(), "scale": found.felt.scale},
        "pushed": None if motion is None else found.pushed_count(motion),
        "motion": None if motion is None else _settings(motion),
    }
