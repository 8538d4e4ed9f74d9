"""The arm's own process, seen from the session: a transport like any other."""

from __future__ import annotations

import sys
from importlib.util import find_spec

from drivers.core.errors import ConfigurationError, DeviceError
from drivers.core.orders import OrdersUnreadError
from drivers.core.record_process import RecordProcess
from drivers.core.records import Record, RecordKind
from drivers.core.transports import Datagram
from drivers.positioner.ur.checks import UNHEARD
from drivers.positioner.ur.settings import UrSettings, UrWiring

_START_s, _END_s = 30.0, 5.0


class UrProcess:
    """A transport to an arm that another process streams to.

    Args:
        wiring: where the arm is.
        settings: its limits.
        name: the transport's name, in the rig and in recordings.
    """

    def __init__(self, wiring: UrWiring, settings: UrSettings, name: str) -> None:
        self.name, self._wiring, self._settings = name, wiring, settings
        self._child = RecordProcess("drivers.positioner.ur.worker", name)
        self._identity = ""

    @property
    def identity(self) -> str:
        """Model, version and payload of the arm, read when it was connected."""
        return self._identity

    def open(self) -> None:
        """Start the process and wait until it has the arm; all or nothing, repeatable.

        Raises:
            ConfigurationError: the package ur-rtde is not installed.
            DeviceError: the arm does not answer, or must not be moved as it is.
        """
        if self._child.started:
            return
        _check_installed(self.name)
        start = {"name": self.name, "host": self._wiring.host, "settings": self._settings.model_dump(mode="json")}
        self._child.start(start)
        try:
            self._identity = self._child.await_record(RecordKind.READY, _START_s, self._raise_error)["identity"]
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """End the process: the arm brakes and is given back. Idempotent."""
        self._child.close(_END_s)

    def send(self, payload: bytes) -> None:
        """Pass a command on. Raises DeviceError when the process is gone, or waits for an arm that is."""
        try:
            self._child.give({"command": payload.hex()})
        except OrdersUnreadError as error:
            raise DeviceError(UNHEARD.what, where=self.name, hint=UNHEARD.remedy) from error

    def receive(self) -> list[Datagram]:
        """Statuses since the last call, oldest first. Raises DeviceError for what ended the process."""
        return self._child.datagrams(self._raise_error)

    def _raise_error(self, record: Record) -> None:
        if record.kind is RecordKind.ERROR:
            raise DeviceError(record.payload.decode().removeprefix(f"{self.name}: "), where=self.name)


def _check_installed(name: str) -> None:
    if find_spec("rtde_control") is None:
        install = f"python3 -m pip --python {sys.executable} install ur-rtde"
        raise ConfigurationError("the package ur-rtde is not installed", where=name, hint=f"Install it: {install}")
