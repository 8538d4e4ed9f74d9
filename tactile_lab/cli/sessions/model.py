"""``tactile-lab model``: what was touched, as a model for simulators and CAD programs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tactile_lab.cli.options import Json, NoInput, Root, SessionName, writable_folder
from tactile_lab.cli.sessions.choosing import choose_session

if TYPE_CHECKING:
    from tactile_lab.models.model_files import Format

app = typer.Typer(
    help="Models of touched objects, for simulators and CAD programs.",
    no_args_is_help=True,
    rich_markup_mode="markdown",
)

_TOLD_SHARE = 0.1
_FORMATS = "stl, obj, glb, urdf, sdf, mjcf or usd, separated by commas."


@app.callback()
def models() -> None:
    """Models of touched objects, for simulators and CAD programs."""


@app.command()
def export(
    session: SessionName,
    out: Annotated[Path, typer.Option(help="New folder for the files.", callback=writable_folder)],
    formats: Annotated[str, typer.Option("--format", help=_FORMATS, show_default="all that are installed")] = "",
    mass_kg: Annotated[
        float | None,
        typer.Option(min=1e-4, max=100.0, help="The object's mass.", show_default="as weighed, or 600 kg/m³"),
    ] = None,
    friction: Annotated[
        float | None,
        typer.Option(
            min=0.0, max=10.0, help="Coefficient of friction.", show_default="the table's as measured, or 0.5"
        ),
    ] = None,
    name: Annotated[str, typer.Option(help="Name of the model.", show_default="the object's")] = "",
    root: Root = Path("runs"),
    as_json: Json = False,
    no_input: NoInput = False,
) -> None:
    """Export the estimated shape as a rigid body: meshes, URDF, SDF, MJCF and USD.

    The model stands on z = 0. Its surface is closed everywhere: model.json says how uncertain it is, and how much of it
    is a guess between contacts.
    """
    from drivers.core.atomic_files import refuse_existing
    from sessions.recording.session import RESULTS
    from sessions.recording.session_ids import slug
    from tactile_lab.cli.console import answer, emit_json, warn
    from tactile_lab.evaluation.files.properties_file import read_measured
    from tactile_lab.models.model_files import formats_installed, write_model
    from tactile_lab.models.solid_model import make_model

    del no_input
    wanted = _chosen(formats)
    refuse_existing([out])
    found = choose_session(root, session)
    named = slug(name or found.manifest.object_name)
    results = found.folder / RESULTS
    model = make_model(results / "mesh.ply", named, mass_kg, friction, read_measured(results))
    files = write_model(out, model, wanted or formats_installed())
    if as_json:
        emit_json({"session": str(found.folder), "files": [str(file) for file in files], **model.as_json()})
    for file in files:
        answer(str(file))
    guessed = model.uncertainty.guessed_share
    if guessed > _TOLD_SHARE:
        warn(f"{100 * guessed:.0f} % of the surface is a guess between contacts")


def _chosen(formats: str) -> list[Format]:
    """Formats from a comma-separated list. Raises BadParameter."""
    from tactile_lab.models.model_files import Format

    names = [name.strip().lower() for name in formats.split(",") if name.strip()]
    unknown = [name for name in names if name not in set(Format)]
    if unknown:
        raise typer.BadParameter(f"there is no format {unknown[0]!r}; choose from {', '.join(Format)}")
    return [Format(name) for name in names]
