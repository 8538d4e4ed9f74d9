"""The hand's transport over EtherCAT: whole process images out and back, one frame a cycle, on our own master.

A frame is taken only for the answer of the cycle it was sent in. The palm's buffers hold one image each, so a working
counter below 3 means a palm that was late, not a lost frame: the status is then empty, and counted. Every so many
cycles, and whenever something is odd, the frame also asks for the state of all slaves and for the errors their ports
have counted. A slave that has left OP or one too many on the ring ends the transport with its reason in words, until it
is opened again. A link that is gone does not: cycles are lost until it is back, and a palm whose watchdog tripped
meanwhile is brought back to OP with demands of zero. How long to wait for that is for the device to say.
"""

from __future__ import annotations

import contextlib
import struct
from dataclasses import dataclass, replace

from pydantic import Field

from drivers.core.clock import Clock
from drivers.core.configuration import StrictModel
from drivers.core.errors import CodecError, DeviceError
from drivers.core.transports import Datagram
from drivers.ethercat.frames import Command, Telegram, physical
from drivers.ethercat.master import EtherCatMaster, MasterSettings, Slave
from drivers.ethercat.ports import Port, RawPort
from drivers.ethercat.registers import AlCode, AlState, AlStatus, Register
from drivers.shadow.ethercat.cables import CableWatch
from drivers.shadow.ethercat.hand_identity import HandIdentity
from drivers.shadow.ethercat.ring import HandRing, image_telegram
from drivers.shadow.protocol.palm_images import PalmName, Side

_WRITTEN, _READ = 2, 1
_SLAVES = 2


class EthercatSettings(StrictModel):
    """How the hand is reached.

    Attributes:
        interface: network interface the hand is plugged into.
        palm: the palm that must be there; any that can be driven when left out.
        serial: the hand that must be there; any when left out.
        side: the side that must be there, as far as the palm's product code states it; any when left out.
        watchdog_s: palm leaves OP when no command came for so long; when left out it relies on its motors, which halt
            by themselves after 20 ms, as Shadow's own driver does.
        poll_every: the slaves' states are read once in this many cycles.
        master: patience with frames.
    """

    interface: str = Field(min_length=1)
    palm: PalmName | None = None
    serial: int | None = None
    side: Side | None = None
    watchdog_s: float | None = Field(default=None, gt=0.0, le=5.0)
    poll_every: int = Field(default=100, ge=1)
    master: MasterSettings = MasterSettings()


@dataclass
class EthercatCounts:
    """Cycles since the transport was opened.

    Attributes:
        cycles: frames with a process image.
        lost: of these, not back in time.
        stale: late answers of earlier cycles, thrown away.
        damaged: answers that could not be read.
        refused: the palm had not taken the command before, so this one did not reach it.
        empty: the palm had not written a new status.
        openings: how often the ring was brought up.
        restarts: how often the palm's watchdog tripped, and the palm was brought back.
        misread: looks at the ring, while it was brought up, that did not show the hand; SOEM alone has such.
    """

    cycles: int = 0
    lost: int = 0
    stale: int = 0
    damaged: int = 0
    refused: int = 0
    empty: int = 0
    openings: int = 0
    restarts: int = 0
    misread: int = 0

    def problems(self) -> tuple[str, ...]:
        """What was lost or late, in words; empty when nothing was."""
        remarks = {
            f"{self.lost} of {self.cycles} frames lost": self.lost,
            f"{self.stale} frames came back late": self.stale,
            f"{self.damaged} frames came back damaged": self.damaged,
            f"{self.refused} commands not accepted by a late palm": self.refused,
            f"{self.empty} cycles without a new status": self.empty,
            f"the palm's watchdog tripped {self.restarts} times because no commands came": self.restarts,
            f"the hand was not found in the first {self.misread} scans of its EtherCAT ring": self.misread,
        }
        return tuple(words for words, count in remarks.items() if count)


def find_palm(settings: EthercatSettings, clock: Clock, port: Port | None = None) -> PalmName:
    """Which palm is on the ring, by its product code; no slave changes its state.

    Args:
        settings: where it is, and what must be there.
        clock: the session's.
        port: as for :class:`EthercatTransport`.

    Raises:
        DeviceError: what is missing or wrong, and what to do; also for a product code that cannot be driven.
    """
    master = EtherCatMaster(port or RawPort(settings.interface), clock, settings.master)
    master.open()
    try:
        _, _, image = HandRing(master, settings.palm, settings.serial, side=settings.side).look()
        return image.name
    finally:
        master.close()


class EthercatTransport:
    """A transport to the palm.

    Args:
        name: the device's name in the rig.
        settings: see :class:`EthercatSettings`.
        clock: the session's.
        port: where frames leave; the interface's raw socket unless given.
    """

    def __init__(self, name: str, settings: EthercatSettings, clock: Clock, port: Port | None = None) -> None:
        self.name, self._settings, self._clock = name, settings, clock
        self._master = EtherCatMaster(port or RawPort(settings.interface), clock, settings.master)
        self._ring = HandRing(self._master, settings.palm, settings.serial, settings.watchdog_s, settings.side)
        self._cables = CableWatch(HandRing.BRIDGE, HandRing.PALM)
        self._incomplete = ""
        self._hand: HandIdentity | None = None
        self._known: HandIdentity | None = None
        self._failure: DeviceError | None = None
        self._counts = EthercatCounts()
        self._until_poll, self._polled = 0, False

    # --- lifecycle ---------------------------------------------------------------------------------------------

    def open(self) -> None:
        """Bring the ring to OP; again, when it has failed since. All or nothing.

        Raises:
            DeviceError: what is missing or wrong, and what to do; also when the cable has been put into another hand
                since the transport was first opened.
        """
        if self._hand is not None and self._failure is None:
            return
        openings = self._counts.openings
        self.close()
        self._master.open()
        try:
            self._hand = self._known = self._same(self._ring.bring_up())
            self._cables.clear(self._master)
        except BaseException:
            self._master.close()
            raise
        self._failure, self._incomplete, self._until_poll = None, "", 0
        self._counts = EthercatCounts(openings=openings + 1)

    def close(self) -> None:
        """Send a zero image, bring the slaves to INIT and release the interface. Idempotent."""
        if self._hand is not None:
            farewell = (
                image_telegram(self._hand.image, bytes(self._hand.image.command_bytes)),
                Telegram(Command.BWR, physical(0, Register.AL_CONTROL), struct.pack("<H", AlState.INIT)),
            )
            with contextlib.suppress(DeviceError):  # the interface may be gone, which is why one closes
                self._master.start(farewell)
                self._master.finish(self._settings.master.setup_answer_s)
        self._hand = None
        self._master.close()

    @property
    def hand(self) -> HandIdentity:
        """Who was found on the ring.

        Raises:
            DeviceError: the transport is not open.
        """
        if self._hand is None:
            raise DeviceError("link is not open", where=self.name, hint="Connect the device first")
        return self._hand

    def _same(self, found: HandIdentity) -> HandIdentity:
        """The hand that was found, when it is the one that was there before: its calibration is in use."""
        known = self._known or found
        if (known.bridge, known.palm) != (found.bridge, found.palm):
            what = f"hand {found.serial}, palm {found.image.name}, answers instead of hand {known.serial}"
            hint = "Reconnect the former hand, or start again with the rig file of this hand"
            raise DeviceError(what, where=self.name, hint=hint)
        return found

    # --- the cycle ---------------------------------------------------------------------------------------------

    def send(self, payload: bytes) -> None:
        """Send a command image; :meth:`receive` takes the status.

        Raises:
            CodecError: not of the size of this palm's command.
            DeviceError: the interface is gone.
        """
        image = self.hand.image
        if len(payload) != image.command_bytes:
            what = f"a command of {len(payload)} bytes instead of {image.command_bytes}"
            raise CodecError(what, where=self.name, hint=f'The palm is a {image.name}: set hand.palm to "{image.name}"')
        telegrams = [image_telegram(image, payload)]
        self._polled = self._until_poll <= 0
        if self._polled:
            telegrams.append(Telegram(Command.BRD, physical(0, Register.AL_STATUS), bytes(AlStatus.SIZE)))
            telegrams += self._cables.questions()
        self._until_poll = (self._settings.poll_every if self._polled else self._until_poll) - 1
        self._counts.cycles += 1
        self._master.start(telegrams)

    def receive(self) -> list[Datagram]:
        """The status of this cycle; nothing when the frame was lost, or the link inside the hand is gone.

        Raises:
            DeviceError: a slave has left OP other than by its watchdog, or the ring has grown; every call, until the
                transport is opened again.
        """
        image = self.hand.image
        answers = self._master.finish(self._settings.master.answer_s)
        stamp_ns = self._clock.now_ns()
        if self._failure is not None:
            raise self._failure
        if answers is None:
            self._until_poll = 0
            return []
        self._judge(answers[0].working_counter)
        if self._polled:
            self._cables.on_answers(answers[2:])
            if not self._is_operating(answers[1]):
                self._until_poll = 0
                return []
        return [Datagram(answers[0].data[image.command_bytes :], stamp_ns)]

    def _judge(self, working_counter: int) -> None:
        self._counts.refused += int(not working_counter & _WRITTEN)
        self._counts.empty += int(not working_counter & _READ)
        if not working_counter:
            self._until_poll = 0

    def _is_operating(self, states: Telegram) -> bool:
        """All slaves write their state into the same bytes, bit upon bit."""
        count = states.working_counter
        self._incomplete = f"{count} EtherCAT slaves answer instead of {_SLAVES}" if count != _SLAVES else ""
        if count > _SLAVES:
            self._fail(self._incomplete)
        if count < _SLAVES:
            return False
        together = AlStatus.decode(states.data)
        if together.state == AlState.OP and not together.error:
            return True
        lost = self._master.counts.lost
        try:
            self._bring_back()
        except DeviceError as error:
            if self._master.counts.lost == lost:
                self._fail(error.what)
        return False  # the link was gone again, or no status has come yet

    def _bring_back(self) -> None:
        """Find out who has left OP; a palm whose watchdog has tripped returns to it.

        Raises:
            DeviceError: it was for another reason, it refuses, or the link is gone meanwhile.
        """
        for name, place in (("palm", HandRing.PALM.position), ("bridge", HandRing.BRIDGE.position)):
            status = self._master.al_status(Slave(place))  # by position: after a power cut it has no address
            if (status.state, status.code) == (AlState.SAFEOP, AlCode.WATCHDOG):
                self._counts.restarts += 1
                self._ring.resume(self.hand.image)
            elif status.state != AlState.OP or status.error:
                raise DeviceError(f"the {name} has left operation: it is in {status}", where=self.name)

    def _fail(self, what: str) -> None:
        self._failure = DeviceError(what, where=self.name, hint="Check power and cable, then connect again")
        raise self._failure

    # --- for people --------------------------------------------------------------------------------------------

    @property
    def counts(self) -> EthercatCounts:
        """A copy of the counters."""
        frames = self._master.counts
        return replace(self._counts, lost=frames.lost, stale=frames.stale, damaged=frames.damaged)

    def health(self) -> tuple[str, ...]:
        """What is wrong with the wire, in words; empty when all is well."""
        first = (str(self._failure),) if self._failure else (self._incomplete,) if self._incomplete else ()
        return first + self._cables.problems() + self.counts.problems()
