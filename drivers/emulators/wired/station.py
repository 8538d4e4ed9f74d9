"""The common part of every emulator's process: ``python -m drivers.emulators.wired.station``.

The first line on standard input says, as JSON, what to be; one line of JSON answers that it serves, or why not. The
process ends with its standard input, so that it never outlives the laboratory that started it.
"""

from __future__ import annotations

import importlib
import json
import sys
from typing import Any, Protocol

from drivers.child_process import errors_said, say
from drivers.shadow.real_time import request_real_time
from tactile_lab.clock import MonotonicClock

ROLES = ("plant", "hand", "box", "base", "camera")
PRIORITY = 60
"""Where permitted, devices come before whatever else the machine does: real ones are never late."""


class Station(Protocol):
    """One emulator on its wire."""

    def serve(self) -> None:
        """Serve until standard input ends. Raises DeviceError when its wire goes."""


def main() -> None:
    """Read what to be, be it, and serve."""
    start: dict[str, Any] = json.loads(sys.stdin.readline())
    request_real_time(PRIORITY)
    with errors_said():
        station = _made(start.pop("role"), start)
        say({"ready": True})
        station.serve()


def _made(role: str, start: dict[str, Any]) -> Station:
    """Only this role's modules are loaded: most need no physics and no camera."""
    assert role in ROLES
    made: Station = importlib.import_module(f"drivers.emulators.wired.{role}_station").make(start, MonotonicClock())
    return made


if __name__ == "__main__":
    main()
