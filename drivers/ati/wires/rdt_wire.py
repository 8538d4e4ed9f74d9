"""A Nano17 behind a Net F/T box: RDT records over UDP, and the box's web pages (protocols: Net F/T; Failures)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from drivers.ati.protocols import rdt_codec
from drivers.ati.protocols.rdt_codec import Command
from drivers.ati.wires import net_box
from drivers.ati.wires.conversation import Conversation
from drivers.ati.wires.net_box import INTERNAL_RATE_Hz, NetBoxPage
from drivers.core.contacts import Array
from drivers.core.errors import DeviceError
from drivers.core.transports import Datagram, Transport
from drivers.force.force_fingertip import WrenchSample
from drivers.force.sequences import STUCK_AFTER

_SCALE_TOLERANCE = 1e-6
_FIRST_RECORD_s = 1.0
_OLD_STREAM_s = 0.05


@dataclass(frozen=True)
class BoxPages:
    """The address of a box's web pages, and what they must report.

    Attributes:
        host, port: of its web server.
        rate_hz: records per second to set.
        serial: of the calibration it must use; "" for any.
    """

    host: str
    port: int
    rate_hz: int
    serial: str = ""


class RdtWire:
    """An RDT stream.

    Args:
        counts_per_N, counts_per_Nm: the box's scale; the web pages, if any, must agree.
        pages: the box's web pages; None for a box without pages, whose stream is then started without a check.

    Attributes:
        page: what the box reported when the stream was started.
    """

    stuck_after = STUCK_AFTER
    ranges_SI: Array | None = None

    def __init__(self, counts_per_N: float, counts_per_Nm: float, pages: BoxPages | None = None) -> None:
        self.page: NetBoxPage | None = None
        self._scale = np.repeat([counts_per_N, counts_per_Nm], 3)
        self._pages = pages
        self._records = 0
        self.step = round(INTERNAL_RATE_Hz / net_box.achievable_rate(pages.rate_hz)) if pages else 0

    def start(self, talk: Conversation) -> None:
        """Stop an old stream, check the box, set its rate, start our stream and check that it arrives.

        Raises:
            DeviceError: the box does not answer, is not the expected one, has other settings, or does not stream.
        """
        talk.send(rdt_codec.encode_request(Command.STOP))
        if self._pages is not None:
            talk.wait(_OLD_STREAM_s)
            self._look_at_box(talk.name, self._pages)
        talk.send(rdt_codec.encode_request(Command.START))
        if self._pages is not None:
            self._records = 0
            if talk.until(lambda: self._records or None, _FIRST_RECORD_s) is None:
                raise DeviceError(
                    f"the box at {self._pages.host} answers, but no record arrives",
                    where=talk.name,
                    hint="Check the firewall and that no other program reads this box; otherwise switch the box off "
                    "and on",
                )

    def ask(self, transport: Transport, now_ns: int) -> None:
        """Do nothing: the box streams."""

    def stop(self, transport: Transport) -> None:
        """End the stream. Raises DeviceError."""
        transport.send(rdt_codec.encode_request(Command.STOP))

    def receive(self, datagram: Datagram) -> list[WrenchSample]:
        """Decode one datagram. Raises CodecError when it holds no RDT records."""
        samples = [
            _interpret_status(WrenchSample(datagram.stamp_ns, np.array(counts) / self._scale, sent, measured, status))
            for sent, measured, status, *counts in rdt_codec.records(datagram.payload)
        ]
        self._records += len(samples)
        return samples

    def receive_many(self, datagrams: list[Datagram]) -> tuple[list[WrenchSample], int]:
        """As :meth:`receive` for many datagrams at once, but faster; also returns how many held no records."""
        sound = [datagram for datagram in datagrams if rdt_codec.holds_records(datagram.payload)]
        table = np.frombuffer(b"".join(datagram.payload for datagram in sound), rdt_codec.RECORD)
        wrenches = table["counts"].astype(float) / self._scale
        shares = [len(datagram.payload) // rdt_codec.RECORD.itemsize for datagram in sound]
        stamps_ns = np.repeat(np.array([datagram.stamp_ns for datagram in sound], np.int64), shares).tolist()
        words = (table[name].tolist() for name in ("rdt_sequence", "ft_sequence", "status"))
        self._records += len(table)
        return [*map(_interpret_status, map(WrenchSample, stamps_ns, wrenches, *words))], len(datagrams) - len(sound)

    def health(self) -> tuple[str, ...]:
        """No problems of the wire itself: all faults show in the records."""
        return ()

    def _look_at_box(self, where: str, pages: BoxPages) -> None:
        page = net_box.fetch_page(pages.host, pages.port)
        if pages.serial and page.serial != pages.serial:
            raise _wrong(where, f"the box uses the calibration of {page.serial}, but the rig file names {pages.serial}")
        stated = np.array([self._scale[0], self._scale[3]])
        told = np.array([page.counts_per_N, page.counts_per_Nm])
        if np.any(np.abs(told - stated) > _SCALE_TOLERANCE * stated):
            raise _wrong(
                where,
                f"the box has {told[0]:g} counts per N and {told[1]:g} per N m, "
                "but the rig file says "
                f"{stated[0]:g} and {stated[1]:g}",
            )
        if any(page.tool):
            raise _wrong(where, f"the box applies its own tool transform {page.tool}")
        if not page.rdt_enabled:
            raise _wrong(where, "the box's RDT interface is switched off")
        self.page = page if page.rate_hz == pages.rate_hz else net_box.set_rate(pages.host, pages.port, pages.rate_hz)


def _wrong(where: str, what: str) -> DeviceError:
    return DeviceError(what, where=where, hint="Correct the rig file, or the box's Configurations page")


def _interpret_status(sample: WrenchSample) -> WrenchSample:
    """The sample with the faults and warnings of its status word; a healthy one is returned unchanged."""
    if not sample.status:
        return sample
    faults, remarks = rdt_codec.judge_status(sample.status)
    return replace(sample, faults=faults, remarks=remarks)
