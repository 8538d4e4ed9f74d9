"""The palms by product code: each one's process image, and where it lies in its memory (protocols: Palm images)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from drivers.ethercat.registers import Fmmu, Register, SyncManager
from drivers.shadow.protocol import palm_codec, palm_variants
from drivers.shadow.protocol.palm_codec import PalmCommand, PalmStatus

PalmName = Literal["0220", "0230", "0240", "0250"]

SHADOW_VENDOR = 0x530
BRIDGE_PRODUCT = 0
CAN_BYTES = palm_codec.CAN_BRIDGE.itemsize
IMAGE_BASE = 0x00010000
"""Logical address of the command in the ring's process image."""


@dataclass(frozen=True)
class PalmImage:
    """One kind of palm.

    Attributes:
        name: Shadow's number of its process image.
        products: product codes of boards that use it.
        command_bytes, status_bytes: sizes with the CAN bridge's part, which comes last in each.
        encode_command, decode_command, encode_status, decode_status: between bytes and meaning.
    """

    name: PalmName
    products: tuple[int, ...]
    command_bytes: int
    status_bytes: int
    encode_command: Callable[[PalmCommand], bytes]
    decode_command: Callable[[bytes], PalmCommand]
    encode_status: Callable[[PalmStatus], bytes]
    decode_status: Callable[[bytes], PalmStatus]

    def sync_managers(self, *, watched: bool = False) -> tuple[SyncManager, ...]:
        """Command, CAN command, status, CAN status: back to back from the start of the process memory.

        Args:
            watched: whether commands feed the palm's process data watchdog; Shadow's own master leaves it unused.
        """
        command, status = self.command_bytes - CAN_BYTES, self.status_bytes - CAN_BYTES
        start = int(Register.PROCESS_RAM)
        status_start = start + self.command_bytes
        return (
            SyncManager(start, command, to_slave=True, watched=watched),
            SyncManager(start + command, CAN_BYTES, to_slave=True),
            SyncManager(status_start, status, to_slave=False),
            SyncManager(status_start + status, CAN_BYTES, to_slave=False),
        )

    def fmmus(self) -> tuple[Fmmu, ...]:
        """The command at :data:`IMAGE_BASE`, the status right behind it."""
        start = int(Register.PROCESS_RAM)
        return (
            Fmmu(IMAGE_BASE, self.command_bytes, start, to_slave=True),
            Fmmu(IMAGE_BASE + self.command_bytes, self.status_bytes, start + self.command_bytes, to_slave=False),
        )


PALMS: dict[PalmName, PalmImage] = {
    "0220": PalmImage(
        "0220",
        (0x00000006,),
        70,
        232,
        palm_codec.encode_command,
        palm_codec.decode_command,
        palm_codec.encode_status,
        palm_codec.decode_status,
    ),
    "0230": PalmImage(
        "0230",
        (0x01000000, 0x01000001),
        74,
        428,
        palm_variants.encode_command_0230,
        palm_variants.decode_command_0230,
        palm_variants.encode_status_0230,
        palm_variants.decode_status_0230,
    ),
    "0240": PalmImage(
        "0240",
        (0x00000009,),
        74,
        232,
        palm_variants.encode_command_0240,
        palm_variants.decode_command_0240,
        palm_codec.encode_status,
        palm_codec.decode_status,
    ),
    "0250": PalmImage(
        "0250",
        (0x0000000A,),
        74,
        542,
        palm_variants.encode_command_0240,
        palm_variants.decode_command_0240,
        palm_variants.encode_status_0250,
        palm_variants.decode_status_0250,
    ),
}
"""The palms that can be driven."""

Side = Literal["right", "left"]

SIDES: dict[int, Side] = {0x01000000: "right", 0x01000001: "left"}
"""Side of the hand by the palm's product code; the other palms' codes do not tell it."""

USUAL_PALM: PalmName = "0220"
"""That of most hands, and of emulated ones that nobody wants otherwise."""

WHICH_PALMS = "Palms 0220, 0230, 0240 and 0250 are supported; ask Shadow Robot which process image this board has"
"""Advice for a product code that is none of theirs."""

_OTHER_PRODUCTS = {
    BRIDGE_PRODUCT: "a bridge, not a palm",
    5: "a dummy without a hand",
    0x01000002: "a muscle hand, which this program does not support",
    0x01000003: "a muscle hand, which this program does not support",
}


def palm_of_product(product: int) -> PalmImage | None:
    """The palm with a product code; None for any other board."""
    return next((palm for palm in PALMS.values() if product in palm.products), None)


def describe_product(product: int) -> str:
    """A product code in words."""
    if (palm := palm_of_product(product)) is not None:
        return f"a {palm.name} palm"
    return _OTHER_PRODUCTS.get(product, "a board this program does not know")
