"""``tactile-lab session extract|export|import``: sessions and contacts as files for others, and from others."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from tactile_lab.cli.options import Json, NoInput, Root, SessionName
from tactile_lab.cli.sessions.choosing import choose_session


def extract(
    session: SessionName,
    into: Annotated[Path, typer.Option(help="Folder of the piece, a new session; its name is the new session's.")],
    root: Root = Path("runs"),
    begin: Annotated[float | None, typer.Option("--from", help="Seconds since the first message.")] = None,
    end: Annotated[float | None, typer.Option("--to", help="Seconds since the first message.")] = None,
    links: Annotated[str | None, typer.Option(help="Comma-separated links, for example hand,ft/FF.")] = None,
    samples: Annotated[bool, typer.Option("--samples", help="Keep what viewers show, too.")] = False,
    bare: Annotated[bool, typer.Option("--bare", help="No calibration inside the recording.")] = False,
    as_json: Json = False,
    no_input: NoInput = False,
) -> None:
    """Cut a piece out of a session: some seconds, some links."""
    from sessions.exchange.extracting import Piece, extract
    from tactile_lab.cli.console import answer, emit_json

    del no_input
    wanted = None if links is None else {link.strip() for link in links.split(",")}
    counts = extract(choose_session(root, session), into, Piece(begin, end, wanted, samples, not bare))
    if as_json:
        emit_json({"session": str(into), "messages": counts})
    answer(f"{sum(counts.values())} messages of {len(counts)} topics: {into}")


def export(
    session: SessionName,
    contacts: Annotated[Path | None, typer.Option(help="Contact log to write, JSON (tactile-contacts/1).")] = None,
    csv: Annotated[Path | None, typer.Option(help="New folder for CSV tables and pictures.")] = None,
    hdf5: Annotated[Path | None, typer.Option(help="New HDF5 file with all samples and pictures.")] = None,
    rosbag: Annotated[Path | None, typer.Option(help="New folder for a ROS 2 bag (needs the package rosbags).")] = None,
    archive: Annotated[Path | None, typer.Option(help="New ZIP file with the whole session.")] = None,
    root: Root = Path("runs"),
    dimension: Annotated[
        int | None, typer.Option(min=2, max=3, help="Of the contact log: 2 or 3.", show_default="the session's")
    ] = None,
    as_json: Json = False,
    no_input: NoInput = False,
) -> None:
    """Write a session in a form that others read: its grasps as a contact log, its samples as tables, or all of it."""
    from tactile_lab.cli.console import answer, count, emit_json
    from tactile_lab.workflow import exporting

    del no_input
    if not any((contacts, csv, hdf5, rosbag, archive)):
        raise typer.BadParameter("name at least one of --contacts, --csv, --hdf5, --rosbag, --archive")
    exporting.refuse_existing([place for place in (contacts, csv, hdf5, rosbag, archive) if place is not None])
    found, told = choose_session(root, session), dict[str, object]()
    if contacts is not None:
        log = exporting.export_contacts(found, contacts, dimension)
        touched = sum(len(grasp.contacts) for grasp in log.grasps)
        told |= {"log": str(contacts), "dimension": log.dimension, "grasps": len(log.grasps), "contacts": touched}
        answer(f"{count(len(log.grasps), 'grasp')} with {count(touched, 'contact')}: {contacts}")
    for kind, place in (("csv", csv), ("hdf5", hdf5), ("rosbag", rosbag), ("archive", archive)):
        if place is not None:
            written = exporting.EXPORTS[kind](found, place)
            told |= {kind: str(place), f"{kind}_written": written}
            answer(f"{written} {exporting.UNITS[kind]}: {place}")
    if as_json:
        emit_json(told)


def bring_in(
    file: Annotated[Path, typer.Argument(help="A session's ZIP archive, or timed contacts as CSV or JSON.")],
    root: Root = Path("runs"),
    name: Annotated[str | None, typer.Option(help="Of the new session.", show_default="the archive's")] = None,
    out: Annotated[
        Path | None, typer.Option(help="Contact log made of timed contacts.", show_default="FILE-log.json")
    ] = None,
    mesh: Annotated[Path | None, typer.Option(help="True object of timed contacts: a closed mesh in metres.")] = None,
    point_sigma_mm: Annotated[
        float, typer.Option(min=0.001, max=100.0, help="Of timed contacts that state none.")
    ] = 2.0,
    normal_sigma_deg: Annotated[
        float | None,
        typer.Option(min=0.1, max=90.0, help="Of normals that state none.", show_default="6; 20 for forces"),
    ] = None,
    gap_s: Annotated[float, typer.Option(min=0.0, max=1e6, help="A longer pause begins a new grasp.")] = 0.5,
    as_json: Json = False,
    no_input: NoInput = False,
) -> None:
    """Bring in a session from an archive, or other people's contacts as a log for 'reconstruct'.

    Nothing of an archive is trusted: names, links, sizes and hashes are checked, and nothing is left of a bad one.
    """
    from math import radians

    from sessions.exchange.timed_contacts import ImportSettings
    from tactile_lab.cli.console import answer, count, emit_json, say
    from tactile_lab.workflow.importing import import_contacts, import_session

    del no_input
    if file.suffix.lower() == ".zip":
        session = import_session(file, root, name)
        if as_json:
            emit_json({"session": str(session.folder), "status": session.manifest.status})
        answer(f"session  {session.folder}")
        return
    sigma_rad = None if normal_sigma_deg is None else radians(normal_sigma_deg)
    settings = ImportSettings(point_sigma_mm / 1000, sigma_rad, gap_s)
    target = out or file.with_name(f"{file.stem}-log.json")
    log = import_contacts(file, target, settings, mesh)
    touched = sum(len(grasp.contacts) for grasp in log.grasps)
    if as_json:
        emit_json({"log": str(target), "dimension": log.dimension, "grasps": len(log.grasps), "contacts": touched})
    answer(f"{count(len(log.grasps), 'grasp')} with {count(touched, 'contact')}: {target}")
    say(f"estimate with: tactile-lab reconstruct {target} --out RESULTS")
