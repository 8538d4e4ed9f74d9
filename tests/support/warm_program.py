"""``tactile-lab`` kept warm: one process that has loaded everything, and a copy of it for each call.

Takes lines of JSON, ``{streams, folder, words}``: a copy of the process becomes the program in that folder, with those
files for its standard streams: three times one terminal, or ends of pipes. Answers the copy's process id once it has
them and, in the end, how it ended.
"""

from __future__ import annotations

import json
import os
import signal
import sys
from typing import Any

from tactile_lab.cli.main import main


def load() -> None:
    """What wizards and sessions load when they are called."""
    import rich.progress  # noqa: F401

    import tactile_lab.cli.app
    import tactile_lab.workflow.calibrating_camera
    import tactile_lab.workflow.calibrating_fingertip
    import tactile_lab.workflow.calibrating_forearm
    import tactile_lab.workflow.calibrating_joints
    import tactile_lab.workflow.running  # noqa: F401


def serve() -> None:
    """Call after call, until the orders end."""
    orders = os.fdopen(os.dup(0), encoding="utf-8")
    for line in orders:
        order = json.loads(line)
        streams = [os.open(path, os.O_RDWR | os.O_NOCTTY) for path in order["streams"]]
        child = os.fork()
        if child == 0:
            become(order, streams)
        for descriptor in streams:
            os.close(descriptor)
        print(child, flush=True)
        print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)


def become(order: dict[str, Any], streams: list[int]) -> None:
    """The program, as the leader of a session. Never returns."""
    os.setsid()
    os.close(os.open(order["streams"][0], os.O_RDWR))  # the first terminal that the leader opens becomes its own
    for descriptor, stream in enumerate(streams):
        os.dup2(stream, descriptor)
        os.close(stream)
    sys.stdin, sys.stdout, sys.stderr = open(0), open(1, "w"), open(2, "w", 1)  # noqa: SIM115
    os.chdir(order["folder"])
    signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored in what a background shell starts
    main(order["words"])


if __name__ == "__main__":
    load()
    serve()
