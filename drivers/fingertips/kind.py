"""What the program has to know of a kind of fingertip: everything it does with one goes through an object of these.

A kind is either *linked*, each fingertip having a link of its own, or sends through the *palm*, its readings being part
of the hand's samples. The object is made once and keeps no state; its devices do.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Generic, Protocol, TypeVar

from gtsam import Pose3

from drivers.ati.wires.wire import ForceWire
from drivers.core.clock import Clock
from drivers.core.configuration import StrictModel
from drivers.core.fingertip import FingertipSensor, TipBody
from drivers.core.transports import Datagram, Transport
from drivers.shadow.protocol.tactile_names import TactileNames

Calibration = TypeVar("Calibration")
Calibration_contra = TypeVar("Calibration_contra", contravariant=True)


class NoSettings(StrictModel):
    """Of a kind that has nothing to set."""


class LinkedFingertip(FingertipSensor, Protocol):
    """A fingertip on a link of its own: the live device, and apart from it the decoder that a session listens with."""

    def connect(self) -> None:
        """Open the link and start the readings. All or nothing; repeatable. Raises DeviceError."""

    def close(self) -> None:
        """Idempotent."""

    def receive(self, datagram: Datagram) -> list[Any]:
        """The samples in one message; changes nothing but what is needed to decode. Raises CodecError."""

    def update(self, samples: Sequence[Any], /) -> None:
        """Take samples of :meth:`receive`, oldest first."""


class PalmFingertip(FingertipSensor, Protocol):
    """A fingertip whose readings are part of the hand's samples."""

    def update(self, sample: Any, /) -> None:
        """Take one sample of the hand. Raises CodecError."""


@dataclass(frozen=True)
class TipReport:
    """The report of ``rig check`` on one fingertip.

    Attributes:
        problems: what speaks against using it, in words.
        words: what it is and measures, for people.
        figures: the same for programs; names carry the unit.
    """

    problems: tuple[str, ...] = ()
    words: tuple[str, ...] = ()
    figures: Mapping[str, float | str] = field(default_factory=dict)


class FingertipKind(ABC, Generic[Calibration]):
    """A kind of fingertip. Subclass :class:`LinkedKind` or :class:`PalmKind`, and register an object of the subclass.

    Attributes:
        settings: model of what a rig file may say under the kind's name; every value has a default.
        packaged: its calibration file for the simulated hand that comes with the program; empty where there is none,
            and the simulated fingertips are as the rig's own file says.
    """

    settings: type[StrictModel] = NoSettings
    packaged: str = ""

    @abstractmethod
    def load(self, files: Mapping[str, Path]) -> Mapping[str, Calibration]:
        """What is known of each fingertip, by finger.

        Args:
            files: the rig's calibration files by role; ``fingertips`` is always there.

        Raises:
            ConfigurationError: a file that does not fit.
        """

    @abstractmethod
    def body(self, finger: str, calibration: Calibration) -> TipBody:
        """The fingertip as the physics knows it. Raises ConfigurationError where its skin is no ellipsoid."""

    def surface(self, calibration: Calibration) -> tuple[tuple[float, float, float], Pose3] | None:
        """Semi-axes of the touching ellipsoid, and its pose in the distal frame; None where there is none."""
        body = self.body("", calibration)
        return body.semi_axes_m, body.distal_T_skin

    def force_range_N(self, settings: Any) -> float | None:
        """Calibrated range of its force sensor, smallest axis; None where it has none."""
        return None

    def report(self, tip: FingertipSensor, names: TactileNames, serial: str) -> TipReport:
        """Further findings, besides the sensor's own health.

        Args:
            tip: a sensor of this kind that has listened for a moment.
            names: what fingertips say of themselves through the palm.
            serial: of the sensor that must be there; any when empty.
        """
        return TipReport()


class LinkedKind(FingertipKind[Calibration]):
    """Each fingertip has a link of its own, named ``ft/FINGER``."""

    @abstractmethod
    def device(
        self,
        finger: str,
        calibration: Calibration,
        settings: Any,
        transport: Transport,
        clock: Clock,
        wire: ForceWire | None,
    ) -> LinkedFingertip:
        """The device, not connected.

        Args:
            finger, calibration: which one, as :meth:`load` gave it.
            settings: of the model :attr:`settings`.
            transport: whole messages; for the decoder of a session one that says nothing.
            clock: the session's.
            wire: how the readings come as the rig file says; None in a simulated rig.
        """


class PalmKind(FingertipKind[Calibration]):
    """The readings come with the hand's samples.

    Attributes:
        tactile: what the palm requests, see :data:`drivers.shadow.device.tactile_requests.ROTATIONS`.
    """

    tactile: str

    def usual(self) -> Calibration | None:
        """What to take a fingertip for that nobody has calibrated, to see that it sends; None where that is no use."""
        return None

    @abstractmethod
    def sensor(self, finger: str, calibration: Calibration, settings: Any) -> PalmFingertip:
        """The sensor. Raises ConfigurationError where its calibrations contradict each other."""
