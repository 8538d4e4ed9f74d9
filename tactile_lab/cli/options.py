"""Options and arguments that several commands share, so that they mean the same everywhere."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer


class Method(StrEnum):
    """Ways to estimate, by the names :class:`tactile_lab.slam.tactile_slam.SlamSettings` knows."""

    JOINT = "joint"
    PARTICLE = "particle"
    THESIS_PF = "thesis-pf"
    THESIS_PF_GRAPH = "thesis-pf-graph"
    KNOWN_POSE = "known-pose"
    ODOMETRY = "odometry"
    ICP = "icp"


METHOD_HELP = (
    "joint: shape and trajectory together; particle: calibrated filter; thesis-pf: the filter as printed, "
    "-graph with its pose graph; baselines: known-pose (the true poses), odometry, icp."
)


SHAPE_HELP = (
    "Model of the final shape; auto: field or facets, by evidence; to compare with: gpis, facets, superquadric, "
    "nagata, occupancy, point-cloud, edge-features; or one of an extension."
)

Json = Annotated[bool, typer.Option("--json", help="One JSON document on standard output.")]
Root = Annotated[Path, typer.Option(help="Folder of sessions.")]
LAST = "'last': the newest recorded under --root, which no piece or import is"
SessionName = Annotated[
    str, typer.Argument(metavar="SESSION", help=f"A session's folder, its name under --root, or {LAST}.")
]
RigName = Annotated[str, typer.Option("--rig", help="Name of a shipped rig, or a rig file.")]
AllowUncalibrated = Annotated[
    bool,
    typer.Option(
        "--allow-uncalibrated",
        help="Begin though a calibration is missing, expired, failed or foreign; the session records that.",
    ),
]
NoInput = Annotated[
    bool,
    typer.Option(
        "--no-input",
        help="Never ask: wizards take the usual answers, a file is replaced only with --replace, "
        "a guided session has a simulated operator.",
    ),
]
