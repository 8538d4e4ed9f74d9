"""Options and arguments shared by several commands, so that they mean the same everywhere."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer


class Method(StrEnum):
    """Estimation methods, named as in :class:`tactile_lab.slam.tactile_slam.SlamSettings`."""

    JOINT = "joint"
    PARTICLE = "particle"
    THESIS_PF = "thesis-pf"
    THESIS_PF_GRAPH = "thesis-pf-graph"
    KNOWN_POSE = "known-pose"
    ODOMETRY = "odometry"
    ICP = "icp"


METHOD_HELP = (
    "joint: shape and trajectory estimated together; particle: calibrated particle filter; thesis-pf: "
    "the filter as printed "
    "in the thesis, -graph with its pose graph; baselines: known-pose (the true poses), "
    "odometry, icp."
)


SHAPE_HELP = (
    "Model of the final shape. auto: smooth field or facets, chosen by evidence; others: gpis, facets, superquadric, "
    "nagata, occupancy, point-cloud, edge-features, or one of an extension."
)

Json = Annotated[bool, typer.Option("--json", help="Print one JSON document to standard output.")]
Root = Annotated[Path, typer.Option(help="Folder that contains the sessions.")]
LAST = "'last': the newest session under --root, ignoring extracts and imports"
SessionName = Annotated[
    str, typer.Argument(metavar="SESSION", help=f"A session's folder, its name under --root, or {LAST}.")
]
RigName = Annotated[str, typer.Option("--rig", help="Name of a built-in rig, or a rig file.")]
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
