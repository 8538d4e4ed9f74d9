"""Emulated Net F/T boxes in a process of their own: ``python -m drivers.emulators.net_box_process``.

Takes one line of JSON on standard input, the boxes' hosts and their rate, answers with one line, and serves until its
standard input ends. Then it says how many records each box has sent.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Sequence
from contextlib import ExitStack
from typing import Any, Self

from drivers.ati import rdt_codec
from drivers.emulators.ati_sensor import EmulatedSensor
from drivers.emulators.net_box_server import NetBoxServer
from drivers.emulators.net_box_unit import NetBoxUnit
from tactile_lab.errors import DeviceError

_END_s = 10.0


def main() -> None:
    """Serve."""
    start = json.loads(sys.stdin.readline())
    with ExitStack() as running:
        boxes = [
            running.enter_context(
                NetBoxServer(NetBoxUnit(EmulatedSensor(seed=seed), start["rate_hz"]), host, start["port"])
            )
            for seed, host in enumerate(start["hosts"])
        ]
        _say({"http_ports": [box.http_port for box in boxes]})
        sys.stdin.read()
    _say({"sent": [box.unit.sent for box in boxes]})


def _say(answer: dict[str, Any]) -> None:
    sys.stdout.write(json.dumps(answer) + "\n")
    sys.stdout.flush()


class NetBoxProcess:
    """The other process, from where it is started. A context manager.

    Args:
        hosts: loopback addresses to serve on, one box each.
        rate_hz: of every stream.
        port: of all boxes.

    Attributes:
        http_ports: of the boxes' pages.
        sent: records each box has sent since its last start; known after :meth:`close`.
    """

    def __init__(self, hosts: Sequence[str], rate_hz: int, port: int = rdt_codec.PORT) -> None:
        self._hosts = list(hosts)
        self._start = {"hosts": self._hosts, "rate_hz": rate_hz, "port": port}
        self._process: subprocess.Popen[str] | None = None
        self.http_ports: list[int] = []
        self.sent: list[int] = []

    def __enter__(self) -> Self:
        command = [sys.executable, "-m", "drivers.emulators.net_box_process"]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(json.dumps(self._start) + "\n")
        self._process.stdin.flush()
        if not (line := self._process.stdout.readline()):
            self.close()
            raise DeviceError("the emulated boxes do not start", where=", ".join(self._hosts), hint=_TAKEN)
        self.http_ports = json.loads(line)["http_ports"]
        return self

    def __exit__(self, *ended: object) -> None:
        self.close()

    @property
    def process_id(self) -> int:
        """Of the running process."""
        assert self._process is not None
        return self._process.pid

    def close(self) -> None:
        """End it; idempotent."""
        if self._process is None:
            return
        process, self._process = self._process, None
        try:
            out, _ = process.communicate(timeout=_END_s)
        except subprocess.TimeoutExpired:
            process.kill()
            out, _ = process.communicate()
        told: dict[str, Any] = json.loads(out) if out.strip() else {}
        self.sent = told.get("sent", [])


_TAKEN = "Another program may hold their addresses; end it"

if __name__ == "__main__":
    main()
