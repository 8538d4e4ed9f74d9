"""An emulator's process, seen from the laboratory that started it."""

from __future__ import annotations

import json
import select
import subprocess
import sys
from typing import Any

from tactile_lab.errors import DeviceError

_START_s, _END_s = 60.0, 5.0


class StationProcess:
    """One emulator in a process of its own.

    Args:
        name: of the device, for messages.
        role: one of :data:`drivers.emulators.wired.station.ROLES`.
        start: what it needs to know.
    """

    def __init__(self, name: str, role: str, **start: Any) -> None:
        self.name, self._start = name, {"role": role, **start}
        self._process: subprocess.Popen[str] | None = None

    def start(self) -> None:
        """Start it, without waiting until it serves."""
        command = [sys.executable, "-m", "drivers.emulators.wired.station"]
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, process_group=0
        )  # a group of its own: Ctrl+C is for the session, which ends the emulators
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps(self._start) + "\n")
        self._process.stdin.flush()

    def await_ready(self) -> None:
        """Wait until it serves.

        Raises:
            DeviceError: it does not come up, in its own words.
        """
        process = self._process
        assert process is not None
        assert process.stdout is not None
        told = process.stdout.readline() if select.select([process.stdout], [], [], _START_s)[0] else ""
        answer = json.loads(told) if told else {"error": "its process does not come up"}
        if "error" in answer:
            self.close()
            raise DeviceError(answer["error"], where=f"emulated {self.name}")

    @property
    def running(self) -> bool:
        """Whether its process lives."""
        return self._process is not None and self._process.poll() is None

    def kill(self) -> None:
        """End it at once, as a power cut would."""
        if self._process is not None:
            self._process.kill()
        self.close()

    def close(self) -> None:
        """End it; idempotent."""
        if self._process is None:
            return
        process, self._process = self._process, None
        try:
            process.communicate(timeout=_END_s)
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()
