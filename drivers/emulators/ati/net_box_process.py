"""Emulated Net F/T boxes in a separate process: ``python -m drivers.emulators.ati.net_box_process``.

It reads one line of JSON on standard input with the boxes' hosts and their rate, answers with one line, and serves
until standard input ends. Then it reports how many records each box has sent.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from contextlib import ExitStack
from typing import Any, Self

from drivers.ati.protocols import rdt_codec
from drivers.core.child_process import ChildProcess, errors_said, say
from drivers.core.errors import DeviceError
from drivers.emulators.ati.net_box_server import NetBoxServer
from drivers.emulators.ati.net_box_unit import NetBoxUnit
from drivers.emulators.ati.sensor import EmulatedSensor

_START_s, _END_s = 30.0, 10.0


def main() -> None:
    """Serve until standard input ends."""
    with errors_said(), ExitStack() as running:
        start = json.loads(sys.stdin.readline())
        boxes = [
            running.enter_context(
                NetBoxServer(NetBoxUnit(EmulatedSensor(seed=seed), start["rate_hz"]), host, start["port"])
            )
            for seed, host in enumerate(start["hosts"])
        ]
        say({"http_ports": [box.http_port for box in boxes]})
        sys.stdin.read()
    say({"sent": [box.unit.sent for box in boxes]})


class NetBoxProcess:
    """Starts and ends that process. A context manager.

    Args:
        hosts: loopback addresses to serve on, one box each.
        rate_hz: records per second of every stream.
        port: of all boxes.

    Attributes:
        http_ports: ports of the boxes' web pages.
        sent: records each box has sent since its last start; known after :meth:`close`.
    """

    def __init__(self, hosts: Sequence[str], rate_hz: int, port: int = rdt_codec.PORT) -> None:
        self._start: dict[str, Any] = {"hosts": list(hosts), "rate_hz": rate_hz, "port": port}
        self._child = ChildProcess("drivers.emulators.ati.net_box_process", ", ".join(hosts))
        self.http_ports: list[int] = []
        self.sent: list[int] = []

    def __enter__(self) -> Self:
        self._child.start(self._start)
        try:
            self.http_ports = self._child.ready(_START_s)["http_ports"]
        except DeviceError as error:
            where = ", ".join(self._start["hosts"])
            raise DeviceError("the emulated boxes did not start", where=where, hint=_TAKEN) from error
        return self

    def __exit__(self, *ended: object) -> None:
        self.close()

    @property
    def process_id(self) -> int:
        """Id of the running process."""
        return self._child.process_id

    def close(self) -> None:
        """End it; idempotent."""
        if said := self._child.close(_END_s).strip():
            self.sent = json.loads(said)["sent"]


_TAKEN = "Another program may be using their addresses: end it"

if __name__ == "__main__":
    main()
