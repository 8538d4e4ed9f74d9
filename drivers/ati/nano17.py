"""An ATI Nano17 fingertip behind a Net F/T box: the device that owns the RDT stream (protocols C.1, F)."""

from __future__ import annotations

import contextlib

import numpy as np
from pydantic import Field

from drivers.ati import rdt_codec
from drivers.ati.force_tip import ForceTip, ForceTipSettings, WrenchSample
from drivers.ati.rdt_codec import Command
from drivers.fingertip import FingertipCalibration
from drivers.links import Datagram, Link
from tactile_lab.clock import Clock
from tactile_lab.errors import CodecError, DeviceError


class Nano17Settings(ForceTipSettings):
    """Settings of the box beside those of the fingertip.

    Attributes:
        counts_per_N, counts_per_Nm: the box's own figures (its configuration page: cfgcpf, cfgcpt).
        silent_ms: time without any record after which the sensor counts as silent.
    """

    counts_per_N: float = Field(default=1_000_000.0, gt=0.0)
    counts_per_Nm: float = Field(default=1_000_000.0, gt=0.0)
    silent_ms: float = Field(default=100.0, gt=0.0)


class Nano17(ForceTip):
    """One fingertip's force sensor: decodes the stream; :class:`ForceTip` makes loads and contacts of it.

    :meth:`poll` and :meth:`receive` only decode. Whoever drives the session hands the samples to :meth:`update`, live
    and in replay alike.
    """

    def __init__(
        self, finger: str, link: Link, clock: Clock, calibration: FingertipCalibration, settings: Nano17Settings
    ) -> None:
        super().__init__(finger, calibration, settings)
        self.foreign_datagrams = 0
        self._link, self._clock, self._box = link, clock, settings
        self._counts_per_unit = np.repeat([settings.counts_per_N, settings.counts_per_Nm], 3)
        self._connected = False

    def connect(self) -> None:
        """Open the link, end any stream an earlier client left running, and start ours. All or nothing; repeatable.

        Raises:
            DeviceError: the link can not be opened or used.
        """
        if self._connected:
            return
        self._link.open()
        try:
            self._link.send(rdt_codec.encode_request(Command.STOP))
            self._link.send(rdt_codec.encode_request(Command.START))
        except DeviceError:
            self._link.close()
            raise
        self._connected = True

    def close(self) -> None:
        """End the stream and close the link; idempotent. A box that is gone already is no error."""
        if not self._connected:
            return
        self._connected = False
        with contextlib.suppress(DeviceError):  # the link is given up anyway
            self._link.send(rdt_codec.encode_request(Command.STOP))
        self._link.close()

    def poll(self) -> list[WrenchSample]:
        """Everything that waits on the link, decoded, oldest first; datagrams of strangers are counted.

        Raises:
            DeviceError: the link failed.
        """
        samples: list[WrenchSample] = []
        for datagram in self._link.receive():
            try:
                samples += self.receive(datagram)
            except CodecError:
                self.foreign_datagrams += 1
        return samples

    def receive(self, datagram: Datagram) -> list[WrenchSample]:
        """Decode one datagram; changes nothing.

        Raises:
            CodecError: it holds no RDT records.
        """
        return [
            WrenchSample(datagram.stamp_ns, np.array(counts) / self._counts_per_unit, rdt_sequence, ft_sequence, status)
            for rdt_sequence, ft_sequence, status, *counts in rdt_codec.records(datagram.payload)
        ]

    def health(self) -> tuple[str, ...]:
        """As :meth:`ForceTip.health`, and whether the box still sends."""
        problems = list(super().health())
        if self.newest and (silent := (self._clock.now_ns() - self.newest.stamp_ns) / 1e6) > self._box.silent_ms:
            problems.append(f"no record for {silent:.0f} ms")
        if self.foreign_datagrams:
            problems.append(f"{self.foreign_datagrams} datagrams that are no RDT records")
        return tuple(problems)
