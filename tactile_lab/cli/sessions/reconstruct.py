"""``tactile-lab reconstruct``: estimate shape and trajectory from recorded contacts."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from tactile_lab.cli.completion import complete_session, complete_shape
from tactile_lab.cli.options import LARGEST_SEED, LAST, SHAPE_HELP, Json, NoInput, OtherMethod, Root, writable_folder
from tactile_lab.cli.sessions.choosing import resolve_name


def reconstruct(
    source: Annotated[
        str,
        typer.Argument(
            metavar="LOG.json|SESSION",
            help=f"A contact log, a session's folder, its name under --root, or {LAST}.",
            autocompletion=complete_session,
        ),
    ],
    method: OtherMethod = None,
    shape: Annotated[
        str | None, typer.Option(metavar="MODEL", help=SHAPE_HELP, show_default="auto", autocompletion=complete_shape)
    ] = None,
    dimension: Annotated[
        int | None,
        typer.Option(min=2, max=3, help="2: estimate a contour; 3: a surface.", show_default="from the data"),
    ] = None,
    seed: Annotated[
        int | None,
        typer.Option(
            min=0, max=LARGEST_SEED, help="Random seed of the estimation.", show_default="0, or from the session"
        ),
    ] = None,
    settings: Annotated[
        Path | None, typer.Option(help="YAML file with estimation parameters, named as in slam.json.")
    ] = None,
    largest_sigma: Annotated[
        float | None,
        typer.Option(
            min=0.001,
            max=1e9,
            metavar="MM",
            help="Also write the part of the shape with a standard deviation below this: known.ply.",
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Folder for the results.", show_default="next to the data, named by method", callback=writable_folder
        ),
    ] = None,
    root: Root = Path("runs"),
    as_json: Json = False,
    no_input: NoInput = False,
) -> None:
    """Estimate shape and trajectory from recorded contacts, and evaluate them if the ground truth is known.

    The ground truth in a log or session is used by the evaluation only, and by the method known-pose.
    """
    _check_log(Path(source))
    from tactile_lab.cli.running.progress import LiveProgress
    from tactile_lab.cli.running.results import conclude
    from tactile_lab.workflow.reconstructing import Wishes, reconstruct

    del no_input
    wishes = Wishes(
        method,
        dimension,
        seed,
        settings,
        shape,
        None if largest_sigma is None else largest_sigma / 1000,
    )
    with LiveProgress(f"reconstruction of {source}") as progress:
        finished = reconstruct(resolve_name(root, source), root, wishes, out, progress)
    conclude(finished, as_json)


def _check_log(path: Path) -> None:
    """Tell mistakes in a log of contacts before the estimation is loaded, which takes longer than to read it twice.

    Raises:
        ConfigurationError: the file is no such log, or cannot be read.
    """
    if path.suffix == ".json":
        from drivers.core.reading.bounded_files import refuse_unreachable
        from sessions.exchange.contact_log import read_contact_log

        refuse_unreachable(path)
        read_contact_log(path)
