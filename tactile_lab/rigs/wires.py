"""The wires in a rig file: the connection of each device."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, Field, SerializeAsAny

from drivers.camera.source_settings import CameraSourceSettings
from drivers.core.configuration import StrictModel
from drivers.fingertips.wiring import Wiring
from drivers.force.wire_settings import Port
from drivers.shadow.device.hand_setup import Master
from drivers.shadow.ethercat.hand_transport import EthercatSettings
from tactile_lab.rigs.fingertip_rig import one_place_each

FingertipWires = Annotated[dict[str, Wiring], AfterValidator(one_place_each)]


class HandWiring(StrictModel):
    """The hand on its EtherCAT cable.

    Attributes:
        ethercat: how it is reached.
        master: our own EtherCAT master, or ``pysoem`` (the ``[ethercat]`` extra).
        far_end: for emulators: the network interface at the other end of a virtual cable.
        first_move: before a session nudge each motor, to see that it moves the joint its map says.
        patience_s: without a sign of life from the session for so long the hand's process takes the demands away.
    """

    ethercat: EthercatSettings
    master: Master = "own"
    far_end: str | None = None
    first_move: bool = True
    patience_s: float = Field(default=2.0, gt=0.0, le=60.0)


class RemoteCamera(StrictModel):
    """A program that takes pictures: length-prefixed messages on a TCP connection (docs/real-laboratory.md)."""

    wire: Literal["tcp"]
    host: str = Field(min_length=1)
    port: Port


class LocalCamera(StrictModel):
    """A camera of this computer, read by a separate process."""

    wire: Literal["source"]
    settings: CameraSourceSettings


CameraWiring = Annotated[RemoteCamera | LocalCamera, Field(discriminator="wire")]


class Wires(StrictModel):
    """All wires of a laboratory.

    Attributes:
        hand, base: always there; the latter as the rig's kind of positioner has it.
        fingertips: of force fingertips, finger to wire; none where the palm carries the fingertips' data.
        camera: left out for a rig without one.
    """

    hand: HandWiring
    base: SerializeAsAny[StrictModel]
    fingertips: FingertipWires = Field(default_factory=dict)
    camera: CameraWiring | None = None
