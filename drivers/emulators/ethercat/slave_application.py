"""The processor behind an emulated slave controller, and the controller's statistics of its data."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from drivers.ethercat.registers import SyncManager


class Application(Protocol):
    """The processor behind the controller.

    Attributes:
        sync_managers: the SyncManagers that it requires before SAFEOP.
        service_ns: time from a command's arrival to its status.
    """

    sync_managers: tuple[SyncManager, ...]
    service_ns: int

    def start(self) -> tuple[bytes, ...]:
        """The initial contents of the blocks to the master, on reaching SAFEOP."""

    def serve(self, blocks: tuple[bytes, ...], *, operating: bool) -> tuple[bytes, ...] | None:
        """Process the blocks from the master; returns those to the master, or None if it writes nothing.

        Args:
            blocks: contents, in the order of the SyncManagers.
            operating: whether the slave is in OP; otherwise outputs must stay safe.
        """


class NoApplication:
    """A slave without process data, such as the bridge."""

    sync_managers: tuple[SyncManager, ...] = ()
    service_ns = 0

    def start(self) -> tuple[bytes, ...]:
        return ()

    def serve(self, blocks: tuple[bytes, ...], *, operating: bool) -> tuple[bytes, ...] | None:
        return None


class Service:
    """A command that the application is processing.

    The answer is computed at once and shown when the application's time is over. So this program's computing time is
    part of the time that a real processor takes, and does not add to it.

    Args:
        application: the application that processes the command.
        begun_ns: when the command arrived.

    Attributes:
        looked_at: whether the application has processed it, or did not run.
        answer: the application's answer; None if there is none.
    """

    def __init__(self, application: Application, begun_ns: int) -> None:
        self._application, self._begun_ns = application, begun_ns
        self.looked_at = False
        self.answer: tuple[bytes, ...] | None = None

    @property
    def over_ns(self) -> int:
        """When the answer becomes visible."""
        return self._begun_ns + self._application.service_ns

    @property
    def due_ns(self) -> int:
        """When there is something to do."""
        return self.over_ns if self.looked_at else self._begun_ns

    def look(self, blocks: tuple[bytes, ...] | None, *, operating: bool) -> None:
        """See :meth:`Application.serve`; without blocks the application does not run."""
        self.answer = None if blocks is None else self._application.serve(blocks, operating=operating)
        self.looked_at = True


@dataclass
class SlaveCounts:
    """Statistics of the process data.

    Attributes:
        commands: accepted from the master.
        refused: not accepted, because the application had not read the one before.
        statuses: read by the master.
        empty: reads by the master without a new status.
        watchdog_trips: falls to SAFEOP for lack of commands.
    """

    commands: int = 0
    refused: int = 0
    statuses: int = 0
    empty: int = 0
    watchdog_trips: int = 0
