"""``tactile-lab session extract|export|import``: exchange sessions and contacts as files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from tactile_lab.cli.options import Json, NoInput, Root, SessionName, writable_file, writable_folder
from tactile_lab.cli.sessions.choosing import choose_session


def extract(
    session: SessionName,
    into: Annotated[
        Path,
        typer.Option(help="Folder of the new session; its name becomes the session's name.", callback=writable_folder),
    ],
    root: Root = Path("runs"),
    begin: Annotated[float | None, typer.Option("--from", help="In seconds after the first message.")] = None,
    end: Annotated[float | None, typer.Option("--to", help="In seconds after the first message.")] = None,
    links: Annotated[str | None, typer.Option(help="Comma-separated transports, for example hand,ft/FF.")] = None,
    samples: Annotated[bool, typer.Option("--samples", help="Also keep the topics for viewers.")] = False,
    bare: Annotated[bool, typer.Option("--bare", help="Leave the calibration out of the recording.")] = False,
    as_json: Json = False,
    no_input: NoInput = False,
) -> None:
    """Extract part of a session: a time span, some transports."""
    from sessions.exchange.extracting import Piece, extract
    from tactile_lab.cli.console import answer, emit_json

    del no_input
    wanted = None if links is None else {link.strip() for link in links.split(",") if link.strip()}
    counts = extract(choose_session(root, session), into, Piece(begin, end, wanted, samples, not bare))
    if as_json:
        emit_json({"session": str(into), "messages": counts})
    answer(f"{sum(counts.values())} messages on {len(counts)} topics: {into}")


def export(
    session: SessionName,
    contacts: Annotated[
        Path | None, typer.Option(help="Write a contact log to this file: JSON (tactile-contacts/1).")
    ] = None,
    csv: Annotated[Path | None, typer.Option(help="Write CSV tables and pictures to this new folder.")] = None,
    hdf5: Annotated[Path | None, typer.Option(help="Write all samples and pictures to this new HDF5 file.")] = None,
    parquet: Annotated[
        Path | None, typer.Option(help="Write Parquet tables with units to this new folder, pictures among them.")
    ] = None,
    lerobot: Annotated[
        Path | None, typer.Option(help="Write a LeRobotDataset of one episode to this new folder.")
    ] = None,
    rosbag: Annotated[
        Path | None, typer.Option(help="Write a ROS 2 bag to this new folder (needs the package rosbags).")
    ] = None,
    foxglove: Annotated[
        Path | None,
        typer.Option(help="Write frames, contacts, surface and pictures to this new MCAP file, for Foxglove."),
    ] = None,
    rerun: Annotated[Path | None, typer.Option(help="Write the same to this new RRD file, for Rerun.")] = None,
    tum: Annotated[
        Path | None,
        typer.Option(help="Write the estimated and the true trajectory to this new folder, in TUM's text format."),
    ] = None,
    archive: Annotated[Path | None, typer.Option(help="Write the whole session to this new ZIP file.")] = None,
    other: Annotated[
        list[str] | None,
        typer.Option(
            "--as", metavar="NAME=PLACE", help="Write it by an exporter of an extension or plug-in. Can be repeated."
        ),
    ] = None,
    root: Root = Path("runs"),
    dimension: Annotated[
        int | None,
        typer.Option(min=2, max=3, help="Dimension of the contact log: 2 or 3.", show_default="from the session"),
    ] = None,
    as_json: Json = False,
    no_input: NoInput = False,
) -> None:
    """Export a session to other formats: its grasps as a contact log, its samples as tables, or the whole session."""
    from dataclasses import asdict

    from drivers.core.atomic_files import refuse_existing, refuse_unwritable
    from tactile_lab.cli.console import answer, count, emit_json, say
    from tactile_lab.workflow import exporting
    from tactile_lab.workflow.exporters import export_as

    del no_input
    kinds = {
        "csv": csv,
        "hdf5": hdf5,
        "parquet": parquet,
        "lerobot": lerobot,
        "rosbag": rosbag,
        "foxglove": foxglove,
        "rerun": rerun,
        "tum": tum,
        "archive": archive,
    }
    others = _places(other or ())
    places = [place for place in (contacts, *kinds.values()) if place is not None]
    places += [place for _, place in others]
    if not places:
        raise typer.BadParameter("give at least one of --contacts, --" + ", --".join([*kinds, "as"]))
    refuse_existing(places)
    for target in places:
        refuse_unwritable(target)
    found, told = choose_session(root, session), dict[str, object]()
    if contacts is not None:
        log = exporting.export_contacts(found, contacts, dimension)
        told |= {"log": str(contacts), **asdict(log)}
        answer(f"{count(log.grasps, 'grasp')} with {count(log.contacts, 'contact')}: {contacts}")
        if log.vertical:
            say(f"left out: {count(log.vertical, 'contact')} from above, which the plane does not have (--dimension 3)")
    for kind, place in kinds.items():
        if place is not None:
            written = exporting.EXPORTS[kind](found, place)
            told |= {kind: str(place), f"{kind}_written": written}
            answer(f"{written} {exporting.UNITS[kind]}: {place}")
    for name, place in others:
        words = export_as(name, found, place)
        told |= {name: str(place), f"{name}_written": words}
        answer(f"{words}: {place}")
    if as_json:
        emit_json(told)


def _places(named: Sequence[str]) -> list[tuple[str, Path]]:
    """Exporters and where they write. Raises ConfigurationError for unknown ones, BadParameter for other text."""
    if not named:
        return []
    from tactile_lab.workflow.exporters import EXPORTERS

    found = []
    for text in named:
        name, equals, place = text.partition("=")
        if not equals or not place:
            raise typer.BadParameter(f"{text!r} is not NAME=PLACE, as in --as npz=session.npz")
        EXPORTERS[name]  # an unknown or broken one is told before anything is read
        found.append((name, Path(place)))
    return found


def bring_in(
    file: Annotated[Path, typer.Argument(help="ZIP archive of a session, or timed contacts as CSV or JSON.")],
    root: Root = Path("runs"),
    name: Annotated[str | None, typer.Option(help="Name of the new session.", show_default="from the archive")] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Write the contact log made from timed contacts to this file.",
            show_default="FILE-log.json",
            callback=writable_file,
        ),
    ] = None,
    mesh: Annotated[
        Path | None, typer.Option(help="Timed contacts: mesh of the true object, closed, in metres.")
    ] = None,
    point_sigma_mm: Annotated[
        float, typer.Option(min=0.001, max=100.0, help="Timed contacts: standard deviation of points that state none.")
    ] = 2.0,
    normal_sigma_deg: Annotated[
        float | None,
        typer.Option(
            min=0.1,
            max=90.0,
            help="Timed contacts: standard deviation of normals that state none.",
            show_default="6; 20 for forces",
        ),
    ] = None,
    gap_s: Annotated[
        float, typer.Option(min=0.0, max=1e6, help="Timed contacts: a longer pause starts a new grasp.")
    ] = 0.5,
    as_json: Json = False,
    no_input: NoInput = False,
) -> None:
    """Import a session from an archive, or contacts from other sources as a contact log for 'reconstruct'.

    An archive's names, links, sizes and hashes are checked; nothing is kept of an invalid one.
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
    say(f"next: tactile-lab reconstruct {target} --out RESULTS")


Address = Annotated[str, typer.Argument(metavar="ADDRESS", help="Such as s3://bucket/laboratory.")]


def store(
    session: SessionName,
    address: Address,
    root: Root = Path("runs"),
    as_json: Json = False,
    no_input: NoInput = False,
) -> None:
    """Copy a session to an address elsewhere, completely or not at all (docs/cluster.md)."""
    from sessions.exchange.elsewhere import store_session
    from tactile_lab.cli.console import answer, emit_json

    del no_input
    stored = store_session(choose_session(root, session), _checked(address))
    if as_json:
        emit_json({"session": stored})
    answer(stored)


def fetch(address: Address, root: Root = Path("runs"), as_json: Json = False, no_input: NoInput = False) -> None:
    """Copy a session from its address into a folder of sessions, completely or not at all."""
    from sessions.exchange.elsewhere import fetch_session
    from tactile_lab.cli.console import answer, emit_json

    del no_input
    session = fetch_session(_checked(address), root)
    if as_json:
        emit_json({"session": str(session.folder)})
    answer(f"session  {session.folder}")


def _checked(text: str) -> str:
    """An address as it was typed. Raises BadParameter for a path of this computer."""
    from sessions.exchange.addresses import address_of

    if (address := address_of(text)) is None:
        raise typer.BadParameter(f"{text!r} is no address: one begins with what kind it is of, as s3://")
    return address
