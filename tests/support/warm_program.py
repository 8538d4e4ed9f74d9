"""``tactile-lab`` preloaded: one process that has imported everything, and a fork of it for each call.

It reads lines of JSON, ``{streams, folder, words}``. For each, a fork of the process becomes the program in that
folder, with these files as its standard streams: three times the same terminal, or ends of pipes. The answers are the
fork's process id once it has opened them, and finally its exit code.
"""

from __future__ import annotations

import gc
import json
import os
import signal
import sys
import traceback
from contextlib import suppress
from typing import Any, NoReturn

from tactile_lab.cli.main import main


def load() -> None:
    """Import what wizards and sessions import when they are called, and keep it out of the collector's way."""
    import cv2  # noqa: F401
    import fpdf  # noqa: F401
    import mujoco  # noqa: F401
    import rich.progress  # noqa: F401

    import tactile_lab.cli.app
    import tactile_lab.view.wizard_feed
    import tactile_lab.workflow.calibrating_camera
    import tactile_lab.workflow.calibrating_fingertip
    import tactile_lab.workflow.calibrating_forearm
    import tactile_lab.workflow.calibrating_joints
    import tactile_lab.workflow.running  # noqa: F401

    gc.freeze()


def serve() -> None:
    """Serve call after call, until the orders end."""
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


def become(order: dict[str, Any], streams: list[int]) -> NoReturn:
    """Become the program, as the leader of a process session. Never returns."""
    os.setsid()
    os.close(os.open(order["streams"][0], os.O_RDWR))  # becomes the controlling terminal
    for descriptor, stream in enumerate(streams):
        os.dup2(stream, descriptor)
        os.close(stream)
    sys.stdin, sys.stdout, sys.stderr = open(0), open(1, "w"), open(2, "w", 1)  # noqa: SIM115
    os.chdir(order["folder"])
    signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored in what a background shell starts
    code = 1
    try:
        main(order["words"])
    except SystemExit as ended:
        code = int(ended.code or 0)
    except BaseException:
        traceback.print_exc()
    finally:
        for stream in (sys.stdout, sys.stderr):
            with suppress(OSError, ValueError):
                stream.flush()
        os._exit(code)  # to take all modules apart would take longer than most calls


if __name__ == "__main__":
    load()
    serve()
