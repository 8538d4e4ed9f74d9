"""The common part of every emulator's process: ``python -m drivers.emulators.laboratory.host``.

The first line on standard input says, as JSON, what to be; one line of JSON answers that it serves, or why not. The
process ends with its standard input, so that it never outlives the laboratory that started it.
"""

from __future__ import annotations

import importlib
import json
import sys
from typing import Any, Protocol

from drivers.core.child_process import errors_said, say
from drivers.core.clock import MonotonicClock
from drivers.core.extensions import load_named_extensions
from drivers.shadow.device.real_time import request_real_time

ROLES = ("plant", "hand", "camera")
"""Those that every laboratory has; stand-ins of wires and positioners are modules that their kinds name."""

PRIORITY = 60
"""Where permitted, devices come before whatever else the machine does: real ones are never late."""


class EmulatorHost(Protocol):
    """One emulator on its wire."""

    def serve(self) -> None:
        """Serve until standard input ends. Raises DeviceError when its wire goes."""


def main() -> None:
    """Read what to be, be it, and serve."""
    with errors_said():
        start: dict[str, Any] = json.loads(sys.stdin.readline())
        request_real_time(PRIORITY)
        load_named_extensions()
        host = _load_host(start.pop("role"), start)
        say({"ready": True})
        host.serve()


def _load_host(role: str, start: dict[str, Any]) -> EmulatorHost:
    """Only this role's modules are loaded: most need no physics and no camera."""
    module = f"drivers.emulators.laboratory.{role}_host" if role in ROLES else role
    made: EmulatorHost = importlib.import_module(module).make(start, MonotonicClock())
    return made


if __name__ == "__main__":
    main()
