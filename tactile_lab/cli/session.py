"""``tactile-lab session``: what was recorded, and understanding it again."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from tactile_lab.cli.console import emit_json, people, say, table, warn

app = typer.Typer(help="Recorded sessions.", no_args_is_help=True)

Root = Annotated[Path, typer.Option(help="Folder of sessions.")]
Json = Annotated[bool, typer.Option("--json", help="One JSON document on standard output.")]
Name = Annotated[str, typer.Argument(help="A session's folder, its name under --root, or 'last'.")]


@app.command("list")
def list_all(root: Root = Path("runs"), as_json: Json = False) -> None:
    """List the sessions in a folder, oldest first."""
    from sessions.listing import list_sessions

    summaries = list_sessions(root)
    if as_json:
        emit_json([asdict(summary) | {"folder": str(summary.folder)} for summary in summaries])
        return
    rows = [
        (s.name, s.status, s.object_name, "" if s.grasps is None else str(s.grasps), f"{s.traffic_bytes / 1e6:.1f}")
        for s in summaries
    ]
    people.print(table(f"Sessions in {root}", ["name", "status", "object", "grasps", "MB"], rows, right=(3, 4)))


@app.command("show")
def show(session: Name, root: Root = Path("runs"), as_json: Json = False) -> None:
    """Show what a session was done with, how it ended and what it recorded."""
    from sessions.listing import find_session

    manifest = find_session(root, session).manifest
    if as_json:
        emit_json(manifest.model_dump(mode="json"))
        return
    facts = [
        ("status", manifest.status + (f": {manifest.problem}" if manifest.problem else "")),
        ("rig", manifest.rig),
        ("object", manifest.object_name),
        ("started, ended", f"{manifest.started_utc}, {manifest.ended_utc or '-'}"),
        ("seeds", ", ".join(f"{name} {seed}" for name, seed in manifest.seeds.items())),
        ("notes", manifest.notes),
        ("versions", ", ".join(f"{name} {number}" for name, number in manifest.versions.items())),
        *((f"calibration {role}", f"{copy.file}  {copy.sha256[:12]}") for role, copy in manifest.calibration.items()),
        *((name, str(number)) for name, number in manifest.counts.items()),
        *((f"lost: {kind}", str(number)) for kind, number in manifest.data_loss.items()),
    ]
    people.print(table(manifest.name, ["", ""], facts))


@app.command("replay")
def replay(
    session: Name,
    root: Root = Path("runs"),
    into: Annotated[Path | None, typer.Option(help="Folder of the new results [default: SESSION/replay].")] = None,
    method: Annotated[str | None, typer.Option(help="Another method than the session's own.")] = None,
    dimension: Annotated[int | None, typer.Option(min=2, max=3, help="Another dimension.")] = None,
    seed: Annotated[int | None, typer.Option(min=0, help="Another seed.")] = None,
    as_json: Json = False,
) -> None:
    """Understand a session again from its raw bytes; by default the result is identical, byte for byte."""
    from sessions.listing import find_session
    from tactile_lab.cli.results import conclude
    from tactile_lab.workflow import differing_files, recorded_seed, recorded_slam, replay_session, slam_settings

    recorded = find_session(root, session)
    own = recorded_slam(recorded)
    same = method is None and dimension is None and seed is None
    settings = own if same else slam_settings(method or own.method, dimension or own.dimension)
    out = into or recorded.folder / "replay"
    finished = replay_session(recorded, settings, recorded_seed(recorded) if seed is None else seed, out)
    if same:
        if differing := differing_files(recorded.results, out):
            warn(f"differs from the recorded results: {', '.join(differing)}")
        else:
            say("identical to the recorded results, byte for byte", "green")
    conclude(finished, as_json)
