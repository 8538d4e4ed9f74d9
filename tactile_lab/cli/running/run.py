"""``tactile-lab run``: run a session."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Literal

import typer

from tactile_lab.cli.completion import complete_object, complete_policy
from tactile_lab.cli.options import (
    LARGEST_SEED,
    MOST_GRASPS,
    AllowUncalibrated,
    Json,
    MethodName,
    NoInput,
    RigName,
    writable_folder,
)
from tactile_lab.cli.running.live_address import LIVE_PORT, Live, LiveAddress, LiveOrigin, LivePort
from tactile_lab.cli.running.page_address import PORT, Certificate, Listen, PageAddress, Port, Token, View

_GUIDED, _EXPLORATION = "Guided sessions", "Choice of the grasps"


class Mode(StrEnum):
    """Who decides about the grasps of a session."""

    AUTONOMOUS = "autonomous"
    GUIDED = "guided"


class LedBy(StrEnum):
    """How the hand is moved in a guided session."""

    KEYS = "keys"
    HAND = "hand"


def run(
    rig: RigName = "sim",
    object_name: Annotated[
        str,
        typer.Option(
            "--object",
            help="Simulated rig: an object of its catalogue, or mesh:FILE (metres).",
            autocompletion=complete_object,
        ),
    ] = "box-10x6x4",
    pose: Annotated[
        str, typer.Option(help="How a mesh rests on the table: standing, lying, or N, the N-th most probable pose.")
    ] = "standing",
    grasps: Annotated[
        int | None,
        typer.Option(min=1, max=MOST_GRASPS, help="Number of grasps.", show_default="from the rig, 16 on sim"),
    ] = None,
    dimension: Annotated[int, typer.Option(min=2, max=3, help="2: estimate a horizontal contour; 3: a surface.")] = 2,
    method: MethodName = "joint",
    seed: Annotated[int, typer.Option(min=0, max=LARGEST_SEED, help="Random seed of the session.")] = 0,
    out: Annotated[
        Path, typer.Option(help="Folder in which the session's folder is created.", callback=writable_folder)
    ] = Path("runs"),
    notes: Annotated[str, typer.Option(help="Notes to store with the session.")] = "",
    mode: Annotated[
        Mode, typer.Option(help="autonomous: the program decides; guided: a person decides.")
    ] = Mode.AUTONOMOUS,
    led_by: Annotated[
        LedBy | None,
        typer.Option(
            help="Guided: the hand is moved by keys, or by hand.",
            show_default="from the rig, keys on sim",
            rich_help_panel=_GUIDED,
        ),
    ] = None,
    automatic_capture: Annotated[
        bool,
        typer.Option(
            "--automatic-capture", help="Guided: capture as soon as the contacts are steady.", rich_help_panel=_GUIDED
        ),
    ] = False,
    pedal: Annotated[
        str, typer.Option(help="Guided: additional key that captures, sent by a foot pedal.", rich_help_panel=_GUIDED)
    ] = "",
    pace: Annotated[
        float | None,
        typer.Option(
            min=0.0,
            max=100.0,
            help="Guided on a simulated rig: simulated seconds per real second; 0: as fast as possible.",
            show_default="1",
            rich_help_panel=_GUIDED,
        ),
    ] = None,
    view: View = False,
    view_port: Port = PORT,
    listen: Listen = "127.0.0.1",
    token: Token = "",
    certificate: Certificate = None,
    live: Live = False,
    live_port: LivePort = LIVE_PORT,
    live_origin: LiveOrigin = "",
    policy: Annotated[
        str | None,
        typer.Option(
            help="Exploration policy that chooses the grasps, such as information; docs/exploration.md lists all.",
            show_default="from the rig",
            rich_help_panel=_EXPLORATION,
            autocompletion=complete_policy,
        ),
    ] = None,
    bounding_box: Annotated[
        bool,
        typer.Option(
            "--bounding-box",
            help="Measure the object's bounding box by touch before the first grasp.",
            rich_help_panel=_EXPLORATION,
        ),
    ] = False,
    weighings: Annotated[
        int,
        typer.Option(
            "--weigh",
            min=0,
            max=MOST_GRASPS,
            help="In the first N grasps, until it is weighed, drag the held object to and fro and lift it by 15 mm.",
        ),
    ] = 0,
    confirm: Annotated[
        bool,
        typer.Option(
            "--confirm",
            help="Ask before every grasp; after a veto the next best is proposed.",
            rich_help_panel=_EXPLORATION,
        ),
    ] = False,
    allow_uncalibrated: AllowUncalibrated = False,
    as_json: Json = False,
    no_input: NoInput = False,
) -> None:
    """Run a session: grasp, estimate, choose the next grasp, and evaluate the result.

    A guided session (docs/guided-sessions.md) says what to do, shows the sensor readings, and captures on a key; with
    --no-input a simulated operator follows the prompts.

    Ctrl+C finishes the current grasp and closes the session; pressed twice, it stops immediately. Either way the
    session can be read.
    """
    from drivers.simulation.object_names import STANDING, in_pose

    if pose != STANDING:
        object_name = in_pose(object_name, pose)
    _refuse_unusable_mesh(object_name)
    from tactile_lab.cli.running.approval import TerminalApproval
    from tactile_lab.cli.running.attending import GuidedWay, attendance
    from tactile_lab.cli.running.progress import LiveProgress
    from tactile_lab.cli.running.results import conclude
    from tactile_lab.cli.sessions.tables import tell_left_open
    from tactile_lab.workflow.running import SessionRequest, check_request, run_session

    guided = mode is Mode.GUIDED
    if confirm and (no_input or guided):
        raise typer.BadParameter("needs an autonomous session", param_hint="'--confirm'")
    if guided and weighings:
        raise typer.BadParameter("needs an autonomous session", param_hint="'--weigh'")
    if not guided:
        _refuse_guided_options(
            {
                "--led-by": led_by is not None,
                "--automatic-capture": automatic_capture,
                "--pedal": bool(pedal),
                "--pace": pace is not None,
            }
        )
    page = PageAddress.if_wanted(view, listen, view_port, token, certificate)
    viewers = LiveAddress.if_wanted(live, rig, live_port, token, live_origin)
    way = GuidedWay(_leader(led_by), automatic_capture or None, pedal, 1.0 if pace is None else pace, no_input)
    request = SessionRequest(
        rig=rig,
        object_name=object_name,
        root=out,
        method=method,
        dimension=dimension,
        seed=seed,
        grasps=grasps,
        notes=notes,
        allow_uncalibrated=allow_uncalibrated,
        policy=policy,
        bounding_box=bounding_box,
        weighings=weighings,
    )
    check_request(request)  # before a page is opened, or a terminal taken
    tell_left_open(out)
    title = f"{object_name} on rig {rig}: {dimension}-D, method {method}, seed {seed}"
    with (
        LiveProgress(title, live=not (guided or confirm), reasons=policy is not None) as progress,
        attendance(way if guided else None, page, viewers, title) as present,
    ):
        finished = run_session(request, progress, replace(present, approve=TerminalApproval()) if confirm else present)
    conclude(finished, as_json)


def _refuse_unusable_mesh(object_name: str) -> None:
    """Tell what is wrong with a mesh before all else is loaded, which takes longer than to read it twice.

    Raises:
        ConfigurationError: it is none, or cannot be used.
    """
    from drivers.simulation.object_names import MESH_PREFIX, posed_path

    if object_name.startswith(MESH_PREFIX):
        from drivers.simulation.mesh_file import read_mesh

        read_mesh(posed_path(object_name)[0])


def _refuse_guided_options(given: Mapping[str, bool]) -> None:
    """Refuse guided options in an autonomous session, whose hand moves by itself. Raises BadParameter."""
    for option, is_given in given.items():
        if is_given:
            raise typer.BadParameter("needs --mode guided", param_hint=f"'{option}'")


def _leader(chosen: LedBy | None) -> Literal["keys", "hand"] | None:
    if chosen is None:
        return None
    return "keys" if chosen is LedBy.KEYS else "hand"
