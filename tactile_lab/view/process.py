"""The page's process: reads settings and messages from standard input, writes button presses to standard output.

It ends with its input, so that no page outlives its session.
"""

from __future__ import annotations

import base64
import json
import os
import sys
import threading
from typing import Any, BinaryIO

from drivers.core.child_process import failure
from drivers.core.errors import TactileLabError

DRAW_PERIOD_s = 0.1


class Mouth:
    """Writes lines to the original standard output; output of libraries is discarded."""

    def __init__(self) -> None:
        self._out: BinaryIO = os.fdopen(os.dup(1), "wb", buffering=0)
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, 1)
        os.close(nowhere)
        self._lock = threading.Lock()

    def say(self, **content: Any) -> None:
        """Write one line of JSON."""
        with self._lock:
            self._out.write(json.dumps(content).encode() + b"\n")


def main() -> int:
    """Show messages until the input ends. Returns the exit code."""
    mouth = Mouth()
    settings = json.loads(sys.stdin.buffer.readline())
    try:
        from tactile_lab.view.page import Page

        with Page(**settings, say=mouth.say) as page:
            mouth.say(url=page.url)
            _show(page)
    except TactileLabError as error:
        mouth.say(problem=str(error), exit_code=error.exit_code)
        return error.exit_code
    except Exception as error:
        mouth.say(problem=failure(error))
        return 1
    return 0


def _show(page: Any) -> None:
    """Read messages in one thread, draw in this one."""
    lock, ended = threading.Lock(), threading.Event()

    def take() -> None:
        try:
            for line in sys.stdin.buffer:
                message = json.loads(line)
                with lock:
                    page.scene.take(message["topic"], base64.b64decode(message["data"]), int(message["stamp_ns"]))
                    page.scene.dropped = int(message["dropped"])
        finally:
            ended.set()

    threading.Thread(target=take, daemon=True).start()
    while not ended.wait(DRAW_PERIOD_s):
        with lock:
            page.draw()


if __name__ == "__main__":
    sys.exit(main())
