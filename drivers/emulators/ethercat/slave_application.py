"""The processor behind an emulated slave controller, and what the controller counts of its data."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from drivers.ethercat.registers import SyncManager


class Application(Protocol):
    """The processor behind the controller.

    Attributes:
        sync_managers: what it insists on before it goes to SAFEOP.
        service_ns: how long it takes from a command's arrival to its status.
    """

    sync_managers: tuple[SyncManager, ...]
    service_ns: int

    def start(self) -> tuple[bytes, ...]:
        """SAFEOP is reached: what the blocks to the master hold at first."""

    def serve(self, blocks: tuple[bytes, ...], *, operating: bool) -> tuple[bytes, ...] | None:
        """Take the blocks from the master; those to the master, or None when it writes nothing.

        Args:
            blocks: contents, in the order of the SyncManagers.
            operating: in OP; else outputs must stay safe.
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
    """A command in the application's hands.

    The answer is computed at once and shown when the application's time is over: what this program needs to compute
    is part of the time that a real processor takes, and does not add to it.

    Args:
        application: has the command.
        begun_ns: when it came.

    Attributes:
        looked_at: whether the application has looked at it, or did not run.
        answer: what it made of it; None for nothing.
    """

    def __init__(self, application: Application, begun_ns: int) -> None:
        self._application, self._begun_ns = application, begun_ns
        self.looked_at = False
        self.answer: tuple[bytes, ...] | None = None

    @property
    def over_ns(self) -> int:
        """When the answer may be seen."""
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
    """What happened to process data.

    Attributes:
        commands: accepted from the master.
        refused: not accepted, because the application had not taken the one before.
        statuses: collected by the master.
        empty: asked for by the master while there was nothing new.
        watchdog_trips: falls to SAFEOP for want of commands.
    """

    commands: int = 0
    refused: int = 0
    statuses: int = 0
    empty: int = 0
    watchdog_trips: int = 0
