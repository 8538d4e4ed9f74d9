"""``tactile-lab session``: list, show and replay recorded sessions."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tactile_lab.cli.options import LARGEST_SEED, Json, NoInput, OtherMethod, Root, SessionName, writable_folder
from tactile_lab.cli.sessions import catalogue as session_catalogue
from tactile_lab.cli.sessions import files as session_files
from tactile_lab.cli.sessions import slips as session_slips
from tactile_lab.cli.sessions.choosing import choose_session, resolve_name

if TYPE_CHECKING:
    from sessions.recording.session import Session

app = typer.Typer(help="Recorded sessions: list, show, replay, recover, export and import.", no_args_is_help=True)
app.command("extract")(session_files.extract)
app.command("export")(session_files.export)
app.command("import")(session_files.bring_in)
app.command("store")(session_files.store)
app.command("fetch")(session_files.fetch)
app.command("catalogue")(session_catalogue.catalogue)
app.command("slips")(session_slips.slips)


@app.command("list")
def list_all(root: Root = Path("runs"), as_json: Json = False, no_input: NoInput = False) -> None:
    """List the sessions in a folder, oldest first."""
    from sessions.recording.listing import list_sessions
    from tactile_lab.cli.console import emit_json, say
    from tactile_lab.cli.sessions.tables import show_sessions

    del no_input
    summaries = list_sessions(root)
    if as_json:
        emit_json([asdict(summary) | {"folder": str(summary.folder)} for summary in summaries])
    elif summaries:
        show_sessions(root, summaries)
    else:
        say(f"no sessions in {root}; record one with: tactile-lab run --out {root}")


@app.command("show")
def show(session: SessionName, root: Root = Path("runs"), as_json: Json = False, no_input: NoInput = False) -> None:
    """Show a session's devices and settings, how it ended and what it recorded."""
    from tactile_lab.cli.console import emit_json
    from tactile_lab.cli.sessions.tables import show_session

    del no_input
    found = choose_session(root, session)
    if as_json:
        emit_json(found.manifest.model_dump(mode="json"))
    else:
        show_session(found)


@app.command("replay")
def replay(
    session: SessionName,
    root: Root = Path("runs"),
    into: Annotated[
        Path | None,
        typer.Option(help="Folder for the new results.", show_default="SESSION/replay", callback=writable_folder),
    ] = None,
    method: OtherMethod = None,
    dimension: Annotated[
        int | None, typer.Option(min=2, max=3, help="Dimension: 2 or 3.", show_default="from the session")
    ] = None,
    seed: Annotated[
        int | None,
        typer.Option(min=0, max=LARGEST_SEED, help="Random seed of the estimation.", show_default="from the session"),
    ] = None,
    speed: Annotated[
        float,
        typer.Option(min=0.0, max=1e6, help="1: original speed; 4: four times as fast; 0: as fast as possible."),
    ] = 0.0,
    as_json: Json = False,
    no_input: NoInput = False,
) -> None:
    """Replay a session from its raw bytes; by default the result is identical, byte for byte.

    The first replay of a session that was killed before it had results writes them to its own results folder.
    """
    from tactile_lab.cli.console import say
    from tactile_lab.cli.running.progress import LiveProgress
    from tactile_lab.cli.running.results import conclude
    from tactile_lab.workflow.finishing import has_results
    from tactile_lab.workflow.replaying import recorded_seed, recorded_slam, replay_session
    from tactile_lab.workflow.running import slam_settings

    del no_input
    recorded = choose_session(root, session)
    own = recorded_slam(recorded)
    same = method is None and dimension is None and seed is None
    settings = own if same else slam_settings(method or own.method, dimension or own.dimension, own.motion)
    comparable = same and has_results(recorded)
    out = into or (recorded.folder / "replay" if comparable or not same else recorded.results)
    chosen = recorded_seed(recorded) if seed is None else seed
    with LiveProgress(f"replay of {recorded.folder}") as progress:
        finished = replay_session(recorded, settings, chosen, out, progress, speed)
    identical = _tell_identity(recorded, out) if comparable and not finished.unread else None
    factor = finished.read_factor or 0.0
    say(f"bytes read {factor:.3g} times as fast as they were recorded")
    conclude(finished, as_json, {"identical": identical, "read_factor": round(factor, 3)})


@app.command("recover")
def recover(
    session: SessionName,
    root: Root = Path("runs"),
    as_json: Json = False,
    no_input: NoInput = False,
) -> None:
    """Recover a session that a crash left open or whose recording is damaged, as a new session; the damaged one is
    kept.

    Results of the damaged session stay there and are listed; 'session replay' makes those of the new one. Exit code 3
    if any data are lost, with the topics listed.
    """
    from sessions.recording.listing import session_folder
    from sessions.recording.recovery import recover
    from tactile_lab.cli.console import emit_json
    from tactile_lab.cli.sessions.tables import recovery_document, show_recovery

    del no_input
    recovery = recover(session_folder(root, resolve_name(root, session)))
    if as_json:
        emit_json(recovery_document(recovery))
    show_recovery(recovery)
    if recovery.lossy:
        raise typer.Exit(3)


def _tell_identity(recorded: Session, out: Path) -> bool:
    """Whether a replay reproduced the session's results; prints the comparison."""
    from sessions.recording.manifest import installed_versions
    from tactile_lab.cli.console import answer, warn
    from tactile_lab.workflow.finishing import differing_files
    from tactile_lab.workflow.plugging import changed_plugins

    differing = differing_files(recorded.results, out)
    if not differing:
        answer("identical to the recorded results, byte for byte", "green")
        return True
    then, now = recorded.manifest.versions, installed_versions()
    changed = [
        f"{name} {then.get(name)} then, {number} now" for name, number in now.items() if then.get(name) != number
    ]
    changed += changed_plugins(recorded)
    reason = f" ({'; '.join(changed)})" if changed else ""
    warn(f"differs from the recorded results: {', '.join(differing)}{reason}")
    return False
