"""A slave's process memory, parts of which SyncManagers guard: blocks that are full or empty, never half of both."""

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
    """Memory guarded by an active SyncManager; ``full`` while the other side has not taken it."""

    number: int
    start: int
    end: int
    to_slave: bool
    watched: bool
    one_buffer: bool
    full: bool = False


class GuardedMemory:
    """Process memory from the master's side, and the blocks' contents from the slave's.

    Args:
        memory: of the whole slave, registers and all; shared with its controller.
        counts: what becomes of the first block each way.
        filled: is told of a block that the master has filled.
    """

    def __init__(self, memory: bytearray, counts: SlaveCounts, filled: Callable[[Block], None]) -> None:
        self._memory, self._counts, self._filled = memory, counts, filled
        self._blocks: list[Block] = []
        self.load()

    def load(self) -> None:
        """Read the SyncManagers' registers; a block that stays what it was stays full."""
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
        """What a SyncManager guards; None when it is off."""
        at = Register.SYNC_MANAGER + SYNC_MANAGER_BYTES * number
        start, length, control, _, active = struct.unpack_from("<HHBBB", self._memory, at)
        if not (active & 1 and length):
            return None
        return Block(number, start, start + length, bool(control & 0x04), bool(control & 0x40), control & 3 == 2)

    @property
    def watched(self) -> bool:
        """Whether a block feeds the watchdog."""
        return any(block.watched for block in self._blocks)

    def missing(self, wanted: Iterable[SyncManager]) -> bool | None:
        """The first of these that guards no block of one buffer: True one to the slave, False one from it, or None."""
        there = {(block.start, block.end - block.start, block.to_slave) for block in self._blocks if block.one_buffer}
        ways = (each.to_slave for each in wanted if (each.start, each.length, each.to_slave) not in there)
        return next(ways, None)

    # --- from the master's side --------------------------------------------------------------------------------

    def read(self, address: int, end: int) -> bytes | None:
        """What unguarded memory and full blocks hold; a block gives itself away with its last byte."""
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
        """Fill unguarded memory and empty blocks; whether any of it was taken."""
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
        """An address range cut at the borders of the guarded blocks; kept, as every cycle asks for the same."""
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
        """What the master has written, block by block."""
        return tuple(bytes(self._memory[block.start : block.end]) for block in self._inward)

    def release(self) -> None:
        """What the master has written is taken: it may write again."""
        for block in self._inward:
            block.full = False

    def publish(self, contents: tuple[bytes, ...]) -> None:
        """Show the master something, in every block that it has emptied."""
        for block, content in zip(self._outward, contents, strict=True):
            if not block.full:
                self._memory[block.start : block.end] = content
                block.full = True
