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


@dataclass
class Block:
    """Memory guarded by an active SyncManager; ``full`` while the other side has not taken it."""

    number: int
    start: int
    end: int
    to_slave: bool
    watched: bool
    one_buffer: bool
    full: bool = False
