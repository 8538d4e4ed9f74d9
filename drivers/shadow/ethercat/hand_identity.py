"""Who is on the hand's ring: its two boards by their EEPROMs, and whether they are the ones that must be there."""

from __future__ import annotations

from dataclasses import dataclass

from drivers.core.errors import DeviceError
from drivers.shadow.protocol.palm_images import (
    BRIDGE_PRODUCT,
    SHADOW_VENDOR,
    SIDES,
    WHICH_PALMS,
    PalmImage,
    PalmName,
    Side,
    describe_product,
    palm_of_product,
)

SERIAL_WORD = 0x0E
"""Where in a board's EEPROM its serial number stands, in words of 16 bits."""


@dataclass(frozen=True)
class BoardIdentity:
    """Who a board is, from its EEPROM."""

    vendor: int
    product: int
    revision: int
    serial: int


@dataclass(frozen=True)
class HandIdentity:
    """The hand found on the ring.

    Attributes:
        bridge, palm: its boards; the palm's serial number is the hand's.
        image: the palm's process image.
        watchdog_s: time without commands after which the palm would leave OP, as read back; None when nothing feeds
            its watchdog, so that it never trips.
    """

    bridge: BoardIdentity
    palm: BoardIdentity
    image: PalmImage
    watchdog_s: float | None

    @property
    def serial(self) -> int:
        """The hand's serial number."""
        return self.palm.serial


def checked_image(
    bridge: BoardIdentity,
    palm: BoardIdentity,
    stated: PalmName | None,
    serial: int | None,
    where: str,
    side: Side | None = None,
) -> PalmImage:
    """The process image of a hand's palm, by its product code.

    Args:
        bridge, palm: the first and the second board on the ring.
        stated: the palm that must be there; any that can be driven when None.
        serial: the hand that must be there; any when None.
        where: the interface or device, for messages.
        side: the side that must be there, if the product code states it; any when None.

    Raises:
        DeviceError: a board that does not belong there, with what to do.
    """
    for name, board in (("first", bridge), ("second", palm)):
        if board.vendor != SHADOW_VENDOR:
            what = f"the {name} slave is from vendor 0x{board.vendor:X}, not from Shadow Robot (0x{SHADOW_VENDOR:X})"
            raise DeviceError(what, where=where, hint="Plug the hand itself into this interface")
    if bridge.product != BRIDGE_PRODUCT:
        what = f"the first slave is {describe_product(bridge.product)} (product {bridge.product:#x}), not the bridge"
        raise DeviceError(what, where=where, hint="Plug the cable into the input of the hand's bridge")
    if (image := palm_of_product(palm.product)) is None:
        what = f"the second slave is {describe_product(palm.product)} (product {palm.product:#x})"
        raise DeviceError(what, where=where, hint=WHICH_PALMS)
    if stated not in (None, image.name):
        hint = f'Set hand.palm to "{image.name}", or leave it out'
        raise DeviceError(f"a {image.name} palm, not a {stated}", where=where, hint=hint)
    if side is not None and SIDES.get(palm.product, side) != side:
        what = f"the palm of a {SIDES[palm.product]} hand, not of a {side} one (product {palm.product:#x})"
        raise DeviceError(what, where=where, hint="Its contacts would be mirrored: connect the hand of the rig file")
    if serial not in (None, palm.serial):
        hint = "Use the rig file and the calibration of the connected hand"
        raise DeviceError(f"hand {palm.serial}, not hand {serial}", where=where, hint=hint)
    return image
