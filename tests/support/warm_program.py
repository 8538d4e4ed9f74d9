"""``tactile-lab`` kept warm: one process that has loaded everything, and a copy of it for each call.

Takes lines of JSON, ``{terminal, folder, words}``: a copy of the process becomes the program on that terminal, in that
folder. Answers ``ready`` when it has the terminal and, in the end, how the copy ended.
"""

from __future__ import annotations

import json
import os
import signal
import sys
from typing import Any

from tactile_lab.cli.main import main


def load() -> None:
    """What the wizards load when they are called."""
    import rich.progress  # noqa: F401

    import tactile_lab.cli.app
    import tactile_lab.workflow.calibrating
    import tactile_lab.workflow.calibrating_camera
    import tactile_lab.workflow.calibrating_fingertip
    import tactile_lab.workflow.calibrating_joints  # noqa: F401


def serve() -> None:
    """Call after call, until the orders end."""
    orders = os.fdopen(os.dup(0), encoding="utf-8")
    for line in orders:
        order = json.loads(line)
        terminal = os.open(order["terminal"], os.O_RDWR | os.O_NOCTTY)
        print("ready", flush=True)
        child = os.fork()
        if child == 0:
            become(order, terminal)
        os.close(terminal)
        print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)


def become(order: dict[str, Any], terminal: int) -> None:
    """The program, as the leader of a session on the terminal. Never returns."""
    os.setsid()
    os.close(os.open(order["terminal"], os.O_RDWR))  # the first one that the leader opens becomes its own
    for descriptor in range(3):
        os.dup2(terminal, descriptor)
    sys.stdin, sys.stdout, sys.stderr = open(0), open(1, "w"), open(2, "w")  # noqa: SIM115
    os.chdir(order["folder"])
    signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored in what a background shell starts
    main(order["words"])


if __name__ == "__main__":
    load()
    serve()
