"""The common part of every emulator's process: ``python -m drivers.emulators.laboratory.host``.

The first line on standard input names, as JSON, the device to emulate; the answer is one line of JSON that says that it
serves, or why not. The process ends when its standard input ends, so it never outlives the laboratory that started it.
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
"""Emulators that every laboratory has; the kinds of wires and positioners name the modules of theirs."""

PRIORITY = 60
"""Scheduling priority, if permitted: emulated devices take precedence over all else, since real ones are never late."""


class EmulatorHost(Protocol):
    """One emulator on its wire."""

    def serve(self) -> None:
        """Serve until standard input ends. Raises DeviceError if its wire disappears."""


def main() -> None:
    """Read which device to emulate, create it, and serve."""
    with errors_said():
        start: dict[str, Any] = json.loads(sys.stdin.readline())
        request_real_time(PRIORITY)
        load_named_extensions()
        host = _load_host(start.pop("role"), start)
        say({"ready": True})
        host.serve()


def _load_host(role: str, start: dict[str, Any]) -> EmulatorHost:
    """Load only the modules of this role: most need neither physics nor a camera."""
    module = f"drivers.emulators.laboratory.{role}_host" if role in ROLES else role
    made: EmulatorHost = importlib.import_module(module).make(start, MonotonicClock())
    return made


if __name__ == "__main__":
    main()
