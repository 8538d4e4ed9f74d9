"""A ring of emulated slaves, and faults of its cable."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from drivers.core.errors import CodecError
from drivers.emulators.ethercat.slave import SlaveController
from drivers.ethercat.frames import Telegram, decode_frame, encode_frame, source_of

_LOCAL_BIT = 0x02


@dataclass
class CableFaults:
    """Faults of the cable, which may be changed while it runs.

    Attributes:
        drop: number of next frames to lose on their way to the slaves.
        drop_answers: number of next frames to lose on their way back.
        drop_share: share of frames to lose at random, half of them in each direction.
        hold: number of next answers to hold back and deliver in a burst with the one after them.
        connected: number of slaves that frames reach, counted from the first; None for all.
        unplugged: whether the cable to the master is unplugged, so that nothing arrives.
        damage: number of next frames to damage, which are then lost.
        damaged_at: the slave before which the cable damages them, 0 for the first.
    """

    drop: int = 0
    drop_answers: int = 0
    drop_share: float = 0.0
    hold: int = 0
    connected: int | None = None
    unplugged: bool = False
    damage: int = 0
    damaged_at: int = 0


@dataclass
class CableCounts:
    """Frames at the slaves' end: arrived, lost in either direction, not EtherCAT."""

    frames: int = 0
    lost: int = 0
    foreign: int = 0


class EmulatedRing:
    """Slaves in a row; a frame passes through all of them and comes back.

    Args:
        slaves: the first one next to the master.
        seed: of random losses.
    """

    def __init__(self, slaves: Sequence[SlaveController], seed: int = 0) -> None:
        self.slaves = tuple(slaves)
        self.faults, self.counts = CableFaults(), CableCounts()
        self._rng = np.random.default_rng(seed)
        self._held: list[bytes] = []
        self._reached = len(self.slaves)

    def process(self, frame: bytes) -> list[bytes]:
        """The frames that come back when one is sent: usually just that frame."""
        self.counts.frames += 1
        self._note_links()
        if self.faults.unplugged or self._loses_frame("drop"):
            self.counts.lost += self.faults.unplugged
            return []
        try:
            telegrams = decode_frame(frame)
        except CodecError:
            self.counts.foreign += 1
            return []
        if self._damages(telegrams):
            return []
        source = bytes((source_of(frame)[0] | _LOCAL_BIT,)) + source_of(frame)[1:]
        answer = encode_frame([self._round(telegram) for telegram in telegrams], source)
        return [] if self._loses_frame("drop_answers") else self._in_order(answer)

    @property
    def due_ns(self) -> int | None:
        """When the next slave will have work to do; None if all are done."""
        return min((due_ns for slave in self.slaves if (due_ns := slave.due_ns) is not None), default=None)

    def work(self) -> None:
        """Let the slaves do the work that is due, so that the next frame does not wait for it."""
        for slave in self.slaves:
            slave.work()

    def _round(self, telegram: Telegram, reached: int | None = None) -> Telegram:
        passed = replace(telegram, circulated=False) if telegram.circulated else telegram
        for slave in self.slaves[: self.faults.connected if reached is None else reached]:
            passed = slave.process(passed)
        return passed

    def _note_links(self) -> None:
        """Count a lost link at both ends of a cable that has just been unplugged."""
        connected = self.faults.connected
        reached = 0 if self.faults.unplugged else len(self.slaves) if connected is None else connected
        if reached < self._reached:
            self.slaves[reached].count_lost_link(0)
            if reached:
                self.slaves[reached - 1].count_lost_link(1)
        self._reached = reached

    def _damages(self, telegrams: Sequence[Telegram]) -> bool:
        """Damage the frame: the slave after the bad cable counts it and ignores it; those before it process it."""
        if not self.faults.damage:
            return False
        self.faults.damage -= 1
        self.counts.lost += 1
        at = self.faults.damaged_at
        for telegram in telegrams:
            self._round(telegram, at)
        self.slaves[at].count_damage(0)
        return True

    def _loses_frame(self, way: str) -> bool:
        left, share = getattr(self.faults, way), self.faults.drop_share
        if left:
            setattr(self.faults, way, left - 1)
        lost = bool(left) or (share > 0 and self._rng.random() < share / 2)
        self.counts.lost += lost
        return lost

    def _in_order(self, answer: bytes) -> list[bytes]:
        arrived = [*self._held, answer]
        if self.faults.hold:
            self.faults.hold -= 1
            self._held = arrived
            return []
        self._held = []
        return arrived
