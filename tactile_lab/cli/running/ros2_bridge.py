"""``tactile-lab ros2-bridge``: a node of ROS 2 that shows sessions and starts, stops and steers them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tactile_lab.cli.completion import complete_object, complete_policy
from tactile_lab.cli.options import LARGEST_SEED, MOST_GRASPS, AllowUncalibrated, MethodName, RigName, writable_folder
from tactile_lab.cli.running.run import Mode

if TYPE_CHECKING:
    from tactile_lab.viewers.ros2.feed import Ros2Feed
    from tactile_lab.workflow.running import SessionRequest

LARGEST_DOMAIN = 232
_LOOK_s = 0.2


def ros2_bridge(
    rig: RigName = "sim",
    object_name: Annotated[
        str,
        typer.Option("--object", help="What lies on the table, as for 'run'.", autocompletion=complete_object),
    ] = "box-10x6x4",
    grasps: Annotated[
        int | None,
        typer.Option(min=1, max=MOST_GRASPS, help="Grasps of a session.", show_default="from the rig, 16 on sim"),
    ] = None,
    dimension: Annotated[int, typer.Option(min=2, max=3, help="2: estimate a horizontal contour; 3: a surface.")] = 2,
    method: MethodName = "joint",
    policy: Annotated[
        str | None,
        typer.Option(
            help="Exploration policy that chooses the grasps.",
            show_default="from the rig",
            autocompletion=complete_policy,
        ),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, max=LARGEST_SEED, help="Random seed of the sessions.")] = 0,
    mode: Annotated[
        Mode, typer.Option(help="autonomous: the program decides; guided: the node's clients do.")
    ] = Mode.AUTONOMOUS,
    out: Annotated[
        Path, typer.Option(help="Folder in which the sessions' folders are created.", callback=writable_folder)
    ] = Path("runs"),
    sessions: Annotated[
        int, typer.Option(min=0, max=1000, help="Number of sessions; 0: until Ctrl+C.", show_default="0")
    ] = 0,
    domain: Annotated[int, typer.Option(min=0, max=LARGEST_DOMAIN, envvar="ROS_DOMAIN_ID", help="ROS 2's domain.")] = 0,
    network: Annotated[
        bool,
        typer.Option(
            "--network", help="Also reachable from other computers, all of which may start and steer sessions."
        ),
    ] = False,
    allow_uncalibrated: AllowUncalibrated = False,
) -> None:
    """Be a node of ROS 2: publish sessions while they run, and serve start, stop, capture, undo (docs/ros2.md).

    ROS 2 need not be installed. Each call of /tactile_lab/start runs a session with these options, until Ctrl+C.
    """
    from tactile_lab.cli.console import say
    from tactile_lab.viewers.ros2.feed import Ros2Feed
    from tactile_lab.viewers.ros2.node import Reach
    from tactile_lab.viewers.ros2.opening import require_ros2
    from tactile_lab.workflow.running import SessionRequest, check_request

    require_ros2()
    request = SessionRequest(rig, object_name, out, method, dimension, seed, grasps, "", allow_uncalibrated, policy)
    check_request(request)  # before a node is seen
    with Ros2Feed(rig, Reach(domain, network)) as feed:
        where = "on the network" if network else "on this computer alone"
        say(f"ros2: {feed.url}, {where}; waits for /tactile_lab/start")
        begun = 0
        while not sessions or begun < sessions:
            if feed.wait_for_start(_LOOK_s):
                begun += 1
                _run(request, feed, guided=mode is Mode.GUIDED)


def _run(request: SessionRequest, feed: Ros2Feed, *, guided: bool) -> None:
    """One session; the node reports its end, and continues."""
    from drivers.core.errors import InterruptionError, TactileLabError
    from tactile_lab.cli.console import answer, complain, say, warn
    from tactile_lab.cli.running.progress import LiveProgress
    from tactile_lab.workflow.attending import Attendance
    from tactile_lab.workflow.running import run_session

    before = feed.dropped
    feed.begin(guided=guided)
    try:
        with LiveProgress(f"{request.object_name} on rig {request.rig}", live=not guided) as progress:
            attendance = Attendance(feed, guided, pace=1.0 if guided else 0.0, onlookers=(feed,))
            finished = run_session(request, progress, attendance)
        answer(f"session      {finished.folder}")
        if finished.outcome is not None:
            say(f"session ended: {finished.outcome.reason}")
    except InterruptionError:
        raise
    except TactileLabError as error:  # the next one may be started when it is mended
        complain(str(error))
    finally:
        feed.end()
    if feed.dropped > before:
        warn(f"the bridge was too slow: {feed.dropped - before} messages were not published, but all are recorded")
