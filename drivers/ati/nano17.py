"""An ATI Nano17 fingertip: one device class for all the wires that can carry its readings (protocols C, F).

The usual wire is UDP from a Net F/T box. :mod:`drivers.ati.wires.wire` defines what a wire is; the wires are
:mod:`~drivers.ati.wires.rdt_wire`, :mod:`~drivers.ati.wires.digital_wire`, :mod:`~drivers.ati.wires.controller_wire`,
:mod:`~drivers.ati.wires.can_wire` and :mod:`~drivers.ati.wires.gauge_volts`.
"""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from typing import Any

import numpy as np
from pydantic import Field

from drivers.ati.wires.conversation import Conversation
from drivers.ati.wires.rdt_wire import RdtWire
from drivers.ati.wires.wire import FastWire, ForceWire
from drivers.core.clock import NANOSECONDS, Clock
from drivers.core.contacts import Array
from drivers.core.errors import CodecError, DeviceError
from drivers.core.fingertip import FingertipCalibration, RigidTransform
from drivers.core.transports import Datagram, Transport, link_health
from drivers.force.force_fingertip import ForceTip, ForceTipSettings, WrenchSample
from drivers.force.intrinsic_contact import wrench_transform
from drivers.force.sequences import SequenceMonitor

_MINUTE_ns = 60 * NANOSECONDS


class Nano17Settings(ForceTipSettings):
    """Settings of the sensor, in addition to those of the fingertip.

    Attributes:
        counts_per_N, counts_per_Nm: scale of a Net F/T box, as its configuration page states it (cfgcpf, cfgcpt).
        silent_ms: time without any sample after which the sensor counts as silent.
        sensor_T_tool: pose of the frame in which the readings are wanted, in the device's own frame; the fingertip's
            ``distal_T_sensor`` is then the pose of this tool frame.
        tare_minutes: age at which a tare is reported as a problem, because readings drift with the temperature.
    """

    counts_per_N: float = Field(default=1_000_000.0, gt=0.0)
    counts_per_Nm: float = Field(default=1_000_000.0, gt=0.0)
    silent_ms: float = Field(default=100.0, gt=0.0)
    sensor_T_tool: RigidTransform | None = None
    tare_minutes: float = Field(default=30.0, gt=0.0)


class Nano17(ForceTip):
    """Decodes the stream of one fingertip's force sensor; the base class :class:`ForceTip` computes loads and contacts.

    :meth:`poll` and :meth:`receive` only decode. The caller passes the samples to :meth:`update`, both live and in a
    replay.

    Args:
        finger: the finger that carries the sensor.
        transport: the connection to the device.
        clock: the session's.
        calibration: of the fingertip.
        settings: limits and scale.
        wire: how the readings arrive; by default from a Net F/T box with the scale in the settings.

    Attributes:
        foreign_datagrams: messages that did not come from this device.
        silences: how often the sensor was silent for longer than ``silent_ms``.
        stamp_jumps: how often a sample had an earlier stamp than the sample before it.
    """

    def __init__(
        self,
        finger: str,
        transport: Transport,
        clock: Clock,
        calibration: FingertipCalibration,
        settings: Nano17Settings,
        wire: ForceWire | None = None,
    ) -> None:
        self.wire = wire or RdtWire(settings.counts_per_N, settings.counts_per_Nm)
        super().__init__(finger, calibration, settings, SequenceMonitor(self.wire.stuck_after, self.wire.step))
        self.foreign_datagrams = self.silences = self.stamp_jumps = 0
        self._transport, self._clock, self._box = transport, clock, settings
        self._to_tool = _to_tool(settings.sensor_T_tool)
        self._connected = False

    def connect(self) -> None:
        """Open the transport, end a stream that an earlier client left running, and start our own.

        After a failure the transport is closed again. Can be called again.

        Raises:
            DeviceError: the transport cannot be opened or used, or the device is missing or is not the expected one.
        """
        if self._connected:
            return
        self._transport.open()
        try:
            self.wire.start(Conversation(self._transport, self._clock, self.wire.receive))
            self._check_ranges()
        except BaseException:
            self._transport.close()
            raise
        self._connected = True

    @property
    def identity(self) -> str:
        """Serial number, firmware and date of calibration, as read while connecting; empty where unknown."""
        told: Any = getattr(self.wire, "page", None) or getattr(self.wire, "calibration", None)
        if told is None:
            return ""
        known = ((name, getattr(told, name, "")) for name in ("firmware", "calibrated"))
        return ", ".join([str(told.serial), *(f"{name} {words}" for name, words in known if words)])

    def close(self) -> None:
        """End the stream and close the transport; idempotent. It is not an error if the device has already gone."""
        if not self._connected:
            return
        self._connected = False
        with contextlib.suppress(DeviceError):  # the transport is closed in any case
            self.stop_stream()
        self._transport.close()

    def stop_stream(self) -> None:
        """End the device's stream; data already sent can still be polled. Raises DeviceError."""
        self.wire.stop(self._transport)

    def ask(self) -> None:
        """Request the next reading, if the wire needs requests. Raises DeviceError."""
        self.wire.ask(self._transport, self._clock.now_ns())

    def poll(self) -> list[WrenchSample]:
        """All samples that wait on the transport, oldest first; messages from other devices are counted.

        Raises:
            DeviceError: the transport failed.
        """
        samples = self._decode(self._transport.receive())
        self.ask()
        return samples

    def _decode(self, datagrams: list[Datagram]) -> list[WrenchSample]:
        if len(datagrams) > 1 and self._to_tool is None and isinstance(self.wire, FastWire):
            samples, foreign = self.wire.receive_many(datagrams)
            self.foreign_datagrams += foreign
            return samples
        found: list[WrenchSample] = []
        for datagram in datagrams:
            try:
                found += self.receive(datagram)
            except CodecError:
                self.foreign_datagrams += 1
        return found

    def receive(self, datagram: Datagram) -> list[WrenchSample]:
        """Decode one message; changes only the state of the wire.

        Raises:
            CodecError: the message is not from this device.
        """
        samples = self.wire.receive(datagram)
        if self._to_tool is None:
            return samples
        return [_in_tool_frame(sample, self._to_tool) for sample in samples]

    def update(self, samples: Sequence[WrenchSample]) -> None:
        """As :meth:`ForceTip.update`; also counts silences between samples and stamps that go backwards."""
        if samples and self.newest:
            gap_ns = samples[0].stamp_ns - self.newest.stamp_ns
            self.silences += gap_ns > self._box.silent_ms * 1e6
            self.stamp_jumps += gap_ns < 0
        super().update(samples)

    def health(self) -> tuple[str, ...]:
        """As :meth:`ForceTip.health`, and also whether the device still sends and what its wire reports."""
        problems = [*super().health(), *self.wire.health(), *link_health(self._transport)]
        now_ns = self._clock.now_ns()
        if self.newest and (silent := (now_ns - self.newest.stamp_ns) / 1e6) > self._box.silent_ms:
            problems.append(f"no record for {silent:.0f} ms")
        if self.silences:
            problems.append(f"silent {self.silences} times for more than {self._box.silent_ms:.0f} ms")
        if self.stamp_jumps:
            problems.append(f"stamps went back {self.stamp_jumps} times: the computer's clock was set")
        if self.foreign_datagrams:
            problems.append(f"{self.foreign_datagrams} messages that are not from this sensor")
        if self.tare_record and (age := (now_ns - self.tare_record.stamp_ns) / _MINUTE_ns) > self._box.tare_minutes:
            problems.append(f"tared {age:.0f} minutes ago")
        return tuple(problems)

    def _check_ranges(self) -> None:
        """Raises DeviceError if the sensor's calibrated range differs from the settings: limits would be wrong."""
        told = self.wire.ranges_SI
        if told is not None and np.any(self._range > told * (1 + 1e-6)):
            raise DeviceError(
                f"the sensor's calibrated range is {_in_words(told)}, but the settings say {_in_words(self._range)}",
                where=self._transport.name,
                hint="Correct nano17.force_range_N and nano17.torque_range_Nm in the rig file",
            )


def _to_tool(sensor_T_tool: RigidTransform | None) -> Array | None:
    """Matrix (6, 6) that moves a wrench from the sensor frame to the tool frame."""
    if sensor_T_tool is None:
        return None
    tool_T_sensor = sensor_T_tool.pose().inverse()
    return wrench_transform(tool_T_sensor.rotation().matrix(), tool_T_sensor.translation())


def _in_tool_frame(sample: WrenchSample, to_tool: Array) -> WrenchSample:
    """Build the sample field by field: dataclasses.replace takes four times as long, which matters at 7 kHz."""
    wrench = to_tool @ sample.wrench
    return WrenchSample(
        sample.stamp_ns, wrench, sample.sent, sample.measured, sample.status, sample.faults, sample.remarks
    )


def _in_words(ranges: Array) -> str:
    force, torque = (" ".join(f"{value:g}" for value in part) for part in (ranges[:3], 1e3 * ranges[3:]))
    return f"{force} N, {torque} N mm"
