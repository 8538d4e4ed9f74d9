"""A slave's process memory, parts of which are guarded by SyncManagers: their blocks are either full or empty."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import pairwise

from drivers.emulators.ethercat.slave_application import SlaveCounts
from drivers.ethercat.registers import SYNC_MANAGER_BYTES, Register, SyncManager

SYNC_MANAGERS, RAM_KIB = 4, 1
RAM_START, RAM_END = int(Register.PROCESS_RAM), Register.PROCESS_RAM + 1024 * RAM_KIB


@dataclass
class Block:
    """Memory guarded by an active SyncManager; ``full`` until the other side has read it."""

    number: int
    start: int
    end: int
    to_slave: bool
    watched: bool
    one_buffer: bool
    full: bool = False


class GuardedMemory:
    """Process memory as the master accesses it, and the blocks' contents as the slave accesses them.

    Args:
        memory: the memory of the whole slave, including registers; shared with its controller.
        counts: statistics of the first block in each direction.
        filled: called with each block that the master has filled.
    """

    def __init__(self, memory: bytearray, counts: SlaveCounts, filled: Callable[[Block], None]) -> None:
        self._memory, self._counts, self._filled = memory, counts, filled
        self._blocks: list[Block] = []
        self.load()

    def load(self) -> None:
        """Read the SyncManagers' registers; an unchanged block stays full."""
        full = {(block.number, block.start, block.end) for block in self._blocks if block.full}
        blocks = (self._block(number) for number in range(SYNC_MANAGERS))
        self._blocks = [block for block in blocks if block is not None]
        for block in self._blocks:
            block.full = (block.number, block.start, block.end) in full
        self._inward = [block for block in self._blocks if block.to_slave]
        self._outward = [block for block in self._blocks if not block.to_slave]
        self._first_to_master = self._outward[0].number if self._outward else -1
        self._cuts: dict[tuple[int, int], list[tuple[int, int, Block | None]]] = {}

    def _block(self, number: int) -> Block | None:
        """The block that a SyncManager guards; None if it is off."""
        at = Register.SYNC_MANAGER + SYNC_MANAGER_BYTES * number
        start, length, control, _, active = struct.unpack_from("<HHBBB", self._memory, at)
        if not (active & 1 and length):
            return None
        return Block(number, start, start + length, bool(control & 0x04), bool(control & 0x40), control & 3 == 2)

    @property
    def watched(self) -> bool:
        """Whether a block resets the watchdog."""
        return any(block.watched for block in self._blocks)

    def missing(self, wanted: Iterable[SyncManager]) -> bool | None:
        """The first required SyncManager without a one-buffer block: True for one to the slave, False for one from it,
        or None.
        """
        there = {(block.start, block.end - block.start, block.to_slave) for block in self._blocks if block.one_buffer}
        ways = (each.to_slave for each in wanted if (each.start, each.length, each.to_slave) not in there)
        return next(ways, None)

    # --- from the master's side --------------------------------------------------------------------------------

    def read(self, address: int, end: int) -> bytes | None:
        """Read unguarded memory and full blocks; reading its last byte empties a block."""
        found, data = False, bytearray(end - address)
        for low, high, block in self._segments(address, end):
            if block is not None and (block.to_slave or not block.full):
                self._counts.empty += int(not block.to_slave and block.number == self._first_to_master)
                continue
            data[low - address : high - address] = self._memory[low:high]
            found = True
            if block is not None and high == block.end:
                block.full = False
                self._counts.statuses += int(block.number == self._first_to_master)
        return bytes(data) if found else None

    def write(self, address: int, data: bytes) -> bool:
        """Fill unguarded memory and empty blocks; returns whether anything was accepted."""
        taken = False
        for low, high, block in self._segments(address, address + len(data)):
            if block is not None and (not block.to_slave or block.full):
                self._counts.refused += int(block.to_slave and block.number == 0)
                continue
            self._memory[low:high] = data[low - address : high - address]
            taken = True
            if block is not None and high == block.end:
                block.full = True
                self._filled(block)
        return taken

    def _segments(self, address: int, end: int) -> list[tuple[int, int, Block | None]]:
        """An address range split at the borders of the guarded blocks; cached, because every cycle needs the same."""
        if (known := self._cuts.get((address, end))) is None:
            borders = {address, end}
            borders |= {edge for block in self._blocks for edge in (block.start, block.end) if address < edge < end}
            known = self._cuts[address, end] = [
                (low, high, next((block for block in self._blocks if block.start <= low < block.end), None))
                for low, high in pairwise(sorted(borders))
            ]
        return known

    # --- from the slave's side ---------------------------------------------------------------------------------

    def contents(self) -> tuple[bytes, ...]:
        """The bytes that the master has written, block by block."""
        return tuple(bytes(self._memory[block.start : block.end]) for block in self._inward)

    def release(self) -> None:
        """Empty the blocks that the master has written, so that it may write again."""
        for block in self._inward:
            block.full = False

    def publish(self, contents: tuple[bytes, ...]) -> None:
        """Write new bytes into every block that the master has emptied."""
        for block, content in zip(self._outward, contents, strict=True):
            if not block.full:
                self._memory[block.start : block.end] = content
                block.full = True
