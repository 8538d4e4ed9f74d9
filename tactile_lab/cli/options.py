"""Options and arguments shared by several commands, so that they mean the same everywhere."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated

import typer

from tactile_lab.cli.completion import complete_method, complete_rig, complete_session

LARGEST_SEED = 2**32 - 1
MOST_GRASPS = 1000
"""More than any session had; each takes about a second of computing and 25 s of the hand's time."""
MOST_JOBS = 256


OUR_METHODS = ("joint", "particle", "thesis-pf", "thesis-pf-graph", "known-pose", "odometry", "icp")
"""Estimation methods, named as in :class:`tactile_lab.slam.slam_settings.SlamSettings`; plug-ins have more."""


def _known_method(name: str | None) -> str | None:
    """The method, once it is known that there is one; the estimation itself is loaded for others' methods only."""
    if name is None or name in OUR_METHODS:
        return name
    from tactile_lab.slam.tracking.trackers import METHODS

    if name not in METHODS:
        known = ", ".join(map(repr, METHODS))
        raise typer.BadParameter(f"{name!r} is not one of {known}.")
    return name


_METHOD_HELP = (
    "joint: shape and trajectory estimated together; particle: calibrated particle filter; thesis-pf: "
    "the filter as printed "
    "in the thesis, -graph with its pose graph; baselines: known-pose (the true poses), "
    "odometry, icp; or the method of an extension or plug-in."
)
MethodName = Annotated[
    str, typer.Option("--method", help=_METHOD_HELP, callback=_known_method, autocompletion=complete_method)
]
OtherMethod = Annotated[
    str | None,
    typer.Option(
        "--method",
        help=_METHOD_HELP,
        callback=_known_method,
        autocompletion=complete_method,
        show_default="from the session; joint for a log",
    ),
]

SHAPE_HELP = (
    "Model of the final shape. auto: smooth field or facets, chosen by evidence; others: gpis, facets, superquadric, "
    "nagata, occupancy, point-cloud, edge-features, or one of an extension."
)


def _keep_output(wanted: bool) -> bool:
    """Standard output is for the document alone."""
    from tactile_lab.cli.console import keep_output_for_json

    keep_output_for_json(wanted)
    return wanted


Json = Annotated[
    bool, typer.Option("--json", help="Print one JSON document to standard output.", callback=_keep_output)
]
Root = Annotated[Path, typer.Option(help="Folder that contains the sessions.")]
LAST = "'last': the newest session under --root, ignoring extracts and imports"
SessionName = Annotated[
    str,
    typer.Argument(
        metavar="SESSION",
        help=f"A session's folder, its name under --root, or {LAST}.",
        autocompletion=complete_session,
    ),
]
_RIG = "Name of a built-in rig, or a rig file."
RigName = Annotated[str, typer.Option("--rig", help=_RIG, autocompletion=complete_rig)]
RigArgument = Annotated[str, typer.Argument(metavar="RIG", help=_RIG, autocompletion=complete_rig)]
AllowUncalibrated = Annotated[
    bool,
    typer.Option(
        "--allow-uncalibrated",
        help="Start even if a calibration is missing, expired, failed or belongs to another rig. The session "
        "records this.",
    ),
]
NoInput = Annotated[
    bool,
    typer.Option(
        "--no-input",
        help="Never ask questions: wizards take the default answers, files are replaced only with --replace, "
        "and "
        "a "
        "simulated operator leads guided sessions.",
    ),
]

_SCHEDULER = re.compile(r"(?:(?:tcp|tls)://)?(?:\[[0-9a-fA-F:.]+\]|[^\s:/\[\]]+):([0-9]{1,5})")
_LARGEST_PORT = 65_535


def _scheduler_address(text: str) -> str:
    """An address that cannot be one of a scheduler is told at once, not after a wait for its answer."""
    found = _SCHEDULER.fullmatch(text)
    if text and (found is None or not 0 < int(found[1]) <= _LARGEST_PORT):
        raise typer.BadParameter(f"{text!r} is no address of a scheduler, such as tcp://host:8786.")
    return text


Scheduler = Annotated[
    str,
    typer.Option(
        metavar="ADDRESS",
        callback=_scheduler_address,
        help="Run on the workers of this Dask scheduler (tcp://host:8786, or tls:// with Dask's own configuration).",
    ),
]
Merge = Annotated[
    list[Path] | None,
    typer.Option(
        metavar="FOLDER", help="Take over the finished runs of this folder, from another machine. Can be repeated."
    ),
]


def writable_file(path: Path | None) -> Path | None:
    """A file that cannot be written is named before minutes or hours of work, not after them."""
    if path is not None:
        from sessions.exchange.addresses import refuse_unwritable_anywhere

        refuse_unwritable_anywhere(path)
    return path


def writable_folder(path: Path | None) -> Path | None:
    """The same of a folder, there or not, in which files are to be written."""
    if path is not None:
        from drivers.core.atomic_files import refuse_unwritable_folder

        refuse_unwritable_folder(path)
    return path


def _check_parquet(path: Path | None) -> Path | None:
    """A package that is missing is named as early."""
    if path is not None:
        from drivers.core.installed.extras import require_package

        require_package("pyarrow")
    return writable_file(path)


ParquetFile = Annotated[
    Path | None,
    typer.Option("--parquet", metavar="FILE", help="Write all runs as a Parquet table, too.", callback=_check_parquet),
]
