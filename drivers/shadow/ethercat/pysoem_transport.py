"""The hand's transport over SOEM, the widespread EtherCAT master in C, by way of pysoem (the ``[ethercat]`` extra).

SOEM's licence is the GPL with an exception, or a commercial one: that is why it is optional. It maps process data
from the slaves' EEPROMs; a hand whose EEPROM holds its identity alone needs the built-in master
(:class:`~drivers.shadow.ethercat.hand_transport.EthercatTransport`), and is refused here with that advice.

Four weaknesses of SOEM are made good. A lost frame blocks it for several milliseconds, unless its socket is set not
to block. Then it asks the socket over and over until the answer is there, at the cost of a core: so the answer is
waited for before SOEM looks. It distinguishes answers by an index of sixteen values only, so that after a stall it
can continue with old data for ever: a status is used only when it echoes the last command that the palm had taken
before. And a frame that gets lost while it sets up the ring leaves it with fewer slaves, with other names or process
data than theirs, or with slaves that refuse what they got: so it gets the patience of the settings, and an error must
show in several scans before the ring is refused.
"""

from __future__ import annotations

import fcntl
import importlib
import os
import select
import socket
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from drivers.core.clock import Clock
from drivers.core.errors import CodecError, ConfigurationError, DeviceError
from drivers.core.transports import Datagram
from drivers.ethercat.registers import AL_ERROR, AL_STATE_MASK, AlState, AlStatus
from drivers.shadow.ethercat.hand_identity import SERIAL_WORD, BoardIdentity, HandIdentity, checked_image
from drivers.shadow.ethercat.hand_transport import EthercatCounts, EthercatSettings
from drivers.shadow.protocol.palm_images import PalmImage

LOOKS = 5
"""So often the ring is looked at, and set up, before what was seen counts as what is there."""

_STATE_us, _OP_TRIES = 50_000, 40
_WRITTEN, _READ = 2, 1


class PysoemTransport:
    """A transport to the palm through pysoem.

    Args:
        name: the device's name in the rig.
        settings: as for the built-in master; ``watchdog_s`` has to be left out.
        clock: the session's.

    Raises:
        ConfigurationError: pysoem is not installed, or a watchdog is requested.
    """

    def __init__(self, name: str, settings: EthercatSettings, clock: Clock) -> None:
        if settings.watchdog_s is not None:
            hint = "Leave watchdog_s out, or use the built-in master"
            raise ConfigurationError("pysoem does not set the palm's watchdog", where=name, hint=hint)
        self.name, self._settings, self._clock = name, settings, clock
        self._soem = _pysoem(name)
        self._master: Any = None
        self._sockets: set[int] = set()
        self._hand: HandIdentity | None = None
        self._sent: tuple[int, int] | None = None
        self._taken: tuple[int, int] | None = None
        self.counts = EthercatCounts()

    def open(self) -> None:
        """Bring the ring to OP. All or nothing, repeatable.

        Raises:
            DeviceError: what is missing or wrong, and what to do.
        """
        if self._master is not None:
            return
        master = self._soem.Master()
        before = _packet_sockets()
        self.counts = EthercatCounts()
        try:
            self._open_interface(master)
            self._sockets = _packet_sockets() - before
            for descriptor in self._sockets:
                flags = fcntl.fcntl(descriptor, fcntl.F_GETFL)
                fcntl.fcntl(descriptor, fcntl.F_SETFL, flags | os.O_NONBLOCK)
            with self._patience():
                self._hand = self._bring_up(master)
        except BaseException:
            master.close()
            raise
        self._master = master
        self._sent = self._taken = None

    def close(self) -> None:
        """Bring the slaves to INIT and release the interface. Idempotent."""
        if self._master is not None:
            master, self._master = self._master, None
            master.state = self._soem.INIT_STATE
            master.write_state()
            master.close()

    def send(self, payload: bytes) -> None:
        """Send a command image; :meth:`receive` takes the status.

        Raises:
            CodecError: not of the size of this palm's command.
            DeviceError: the transport is not open.
        """
        image = self._open()
        if len(payload) != image.command_bytes:  # pysoem would copy what there is, unchecked
            raise CodecError(f"a command of {len(payload)} bytes instead of {image.command_bytes}", where=self.name)
        command = image.decode_command(payload)
        self._sent = command.from_motor_data_type, command.which_motors
        self._master.slaves[1].output = payload
        self._master.send_processdata()
        self.counts.cycles += 1

    def receive(self) -> list[Datagram]:
        """The status of this cycle; nothing when the frame was lost, the palm was late or the answer was old.

        Raises:
            DeviceError: a slave has left OP.
        """
        image = self._open()
        patience_s = self._settings.master.answer_s
        arrived = select.select(self._sockets, [], [], patience_s)[0]
        counter = self._master.receive_processdata(round(patience_s * 1e6) if arrived else 0, release_gil=True)
        stamp_ns = self._clock.now_ns()
        if counter >= 0 and self.counts.cycles % self._settings.poll_every == 0:  # a link that is gone tells no state
            self._check_states()
        expected, self._taken = self._taken, self._sent if counter > 0 and counter & _WRITTEN else self._taken
        if counter < 0:
            self.counts.lost += 1
            self._taken = None  # the palm may have taken that command, or not
            return []
        if not counter & _READ:
            self.counts.empty += 1
            return []
        payload = bytes(self._master.slaves[1].input)
        status = image.decode_status(payload)
        if status.written and expected not in (None, (status.motor_data_type, status.which_motors)):
            self.counts.stale += 1
            return []
        return [Datagram(payload, stamp_ns)]

    def health(self) -> tuple[str, ...]:
        """What is wrong with the wire, in words; empty when all is well."""
        return self.counts.problems()

    @property
    def hand(self) -> HandIdentity:
        """Who was found on the ring; SOEM leaves the palm's watchdog unused.

        Raises:
            DeviceError: the transport is not open.
        """
        if self._master is None or self._hand is None:
            raise DeviceError("link is not open", where=self.name, hint="Connect the device first")
        return self._hand

    def _open(self) -> PalmImage:
        return self.hand.image

    def _open_interface(self, master: Any) -> None:
        interface = self._settings.interface
        present = [name for _, name in socket.if_nameindex()]
        if interface not in present:
            raise self._wrong(f"no network interface {interface}", f"Available interfaces: {', '.join(present)}")
        try:
            master.open(interface)
        except ConnectionError as error:
            hint = "pysoem needs the capabilities cap_net_raw and cap_net_admin"
            raise self._wrong(f"cannot open {interface} ({error})", hint) from error

    @contextmanager
    def _patience(self) -> Iterator[None]:
        """While it looks at the ring, SOEM waits for a frame as long as the settings say, in place of its 2 ms."""
        timeouts = self._soem.settings.timeouts
        usual_us, timeouts.ret = timeouts.ret, round(self._settings.master.setup_answer_s * 1e6)
        try:
            yield
        finally:
            timeouts.ret = usual_us

    def _bring_up(self, master: Any) -> HandIdentity:
        """The hand, in operation; looks that did not show it, or did not bring it there, are counted."""
        while True:
            try:
                hand = self._map(master)
                self._operate(master)
                return hand
            except DeviceError as error:
                self.counts.misread += 1
                if self.counts.misread == LOOKS:
                    raise self._wrong(f"{error.what}, at the last of {LOOKS} scans of the ring", error.hint) from error

    def _map(self, master: Any) -> HandIdentity:
        """One look: who is there, with process data as SOEM maps them."""
        count = master.config_init()
        if count != 2:
            raise self._wrong(f"{max(count, 0)} EtherCAT slaves instead of 2", "Check the hand's cable and power")
        first, palm = master.slaves
        bridge, board = _board(first, 0), _board(palm, int.from_bytes(palm.eeprom_read(SERIAL_WORD)[:4], "little"))
        image = checked_image(bridge, board, self._settings.palm, self._settings.serial, self.name, self._settings.side)
        master.config_map()
        if (len(palm.output), len(palm.input)) != (image.command_bytes, image.status_bytes):
            what = f"its EEPROM describes {len(palm.output)} + {len(palm.input)} bytes of process data"
            raise self._wrong(what, "Use the built-in master, which knows the palm's process image")
        return HandIdentity(bridge, board, image, None)

    def _operate(self, master: Any) -> None:
        master.state_check(self._soem.SAFEOP_STATE, _STATE_us)
        master.send_processdata()
        master.receive_processdata(2000)
        master.state = self._soem.OP_STATE
        master.write_state()
        for _ in range(_OP_TRIES):
            if master.state_check(self._soem.OP_STATE, _STATE_us) == self._soem.OP_STATE:
                return
            master.read_state()
            if any(slave.state & AL_ERROR for slave in master.slaves):
                break  # it has refused
            master.send_processdata()
            master.receive_processdata(2000)
        raise self._wrong(f"does not reach OP: it is in {self._status(master.slaves[1])}", "Switch the hand off and on")

    def _check_states(self) -> None:
        self._master.read_state()
        for name, slave in zip(("bridge", "palm"), self._master.slaves, strict=True):
            if slave.state != AlState.OP:
                raise self._wrong(f"the {name} has left operation: it is in {self._status(slave)}", "Connect again")

    @staticmethod
    def _status(slave: Any) -> AlStatus:
        return AlStatus(slave.state & AL_STATE_MASK, bool(slave.state & AL_ERROR), slave.al_status)

    def _wrong(self, what: str, hint: str) -> DeviceError:
        return DeviceError(what, where=self.name, hint=hint)


def _board(slave: Any, serial: int) -> BoardIdentity:
    return BoardIdentity(slave.man, slave.id, slave.rev, serial)


def _pysoem(name: str) -> Any:
    try:
        return importlib.import_module("pysoem")
    except ImportError as error:
        install = f"python3 -m pip --python {sys.executable} install pysoem"
        hint = f"Install it: {install}; or use the built-in master"
        raise ConfigurationError("pysoem is not installed", where=name, hint=hint) from error


def _packet_sockets() -> set[int]:
    """Descriptors of this process's packet sockets; pysoem does not say which is its own."""
    found = set()
    for entry in Path("/proc/self/fd").iterdir():
        try:
            if not str(entry.readlink()).startswith("socket:"):
                continue
            with socket.socket(fileno=os.dup(int(entry.name))) as copy:
                if copy.family == socket.AF_PACKET:
                    found.add(int(entry.name))
        except OSError:
            continue  # closed since the folder was listed
    return found
