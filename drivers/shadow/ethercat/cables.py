"""Which of the hand's cables is bad, by what its slaves' ports have counted."""

from __future__ import annotations

from drivers.ethercat.frames import Command, Telegram, physical
from drivers.ethercat.master import EtherCatMaster, Slave
from drivers.ethercat.port_errors import PORTS, CableErrors, PortErrors
from drivers.ethercat.registers import Register

_RECEIVE_BYTES, _LOST_BYTES = 8, 4
_TOWARDS_MASTER = 0
_NAMES = {
    "the cable between computer and hand": "change it, or the computer's network adapter",
    "the cable inside the hand, between bridge and palm": "the hand needs service",
}


class CableWatch:
    """Gathers the counters of bridge and palm while the ring runs.

    A frame comes in by port 0 of every slave, and comes back in by another port of the bridge: what the bridge counts
    at port 0 befell the first cable, what it counts elsewhere, and what the palm counts at port 0, the second. The way
    back to the computer is counted by its network adapter alone.

    Args:
        bridge, palm: as they are addressed.
    """

    def __init__(self, bridge: Slave, palm: Slave) -> None:
        self._slaves = (bridge, palm)
        self._cables = (CableErrors(), CableErrors())

    def clear(self, master: EtherCatMaster) -> None:
        """Let the slaves count from zero. Raises DeviceError."""
        for slave in self._slaves:
            master.write(slave, Register.ERROR_COUNTERS, bytes(_RECEIVE_BYTES))
            master.write(slave, Register.LOST_LINKS, bytes(_LOST_BYTES))
        self._cables = (CableErrors(), CableErrors())

    def questions(self) -> tuple[Telegram, ...]:
        """Telegrams that ask both slaves for their counters."""
        return tuple(
            Telegram(Command.FPRD, physical(slave.address, Register.ERROR_COUNTERS), bytes(PortErrors.SIZE))
            for slave in self._slaves
        )

    def on_answers(self, answers: tuple[Telegram, ...]) -> None:
        """What came back of :meth:`questions`; of slaves that did not answer nothing new is known."""
        if any(answer.working_counter != 1 for answer in answers):
            return
        bridge, palm = (PortErrors.decode(answer.data) for answer in answers)
        inside = palm.at(_TOWARDS_MASTER)
        for port in range(_TOWARDS_MASTER + 1, PORTS):
            inside = inside.both(bridge.at(port))
        self._cables = (bridge.at(_TOWARDS_MASTER), inside)

    def problems(self) -> tuple[str, ...]:
        """Bad cables in words, with what to do; empty when none is."""
        return tuple(
            f"{name}: {errors}; {remedy}"
            for (name, remedy), errors in zip(_NAMES.items(), self._cables, strict=True)
            if str(errors)
        )
