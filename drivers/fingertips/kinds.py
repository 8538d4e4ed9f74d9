"""All kinds of fingertips, and all wires of those with links of their own, by the names that rig files call them.

See ``docs/extending.md`` for adding one.
"""

from __future__ import annotations

from typing import Any

from drivers.core.registry import Registry
from drivers.fingertips.ati_wires import CanKind, ControllerKind, DigitalKind, NetBoxKind, VoltsKind
from drivers.fingertips.biotac import BioTacKind
from drivers.fingertips.kind import FingertipKind, PalmKind
from drivers.fingertips.nano17 import Nano17Kind
from drivers.fingertips.wires import WireKind

FINGERTIPS: Registry[FingertipKind[Any]] = Registry("fingertip kind", group="fingertips", form=FingertipKind)

FINGERTIPS.register("nano17", Nano17Kind())
FINGERTIPS.register("biotac", BioTacKind())

WIRES: Registry[WireKind[Any]] = Registry("wire", group="wires", form=WireKind)

WIRES.register("net-ft", NetBoxKind())
WIRES.register("digital", DigitalKind())
WIRES.register("controller", ControllerKind())
WIRES.register("can-oem", CanKind())
WIRES.register("gauge-volts", VoltsKind())


def palm_kind(tactile: str) -> str | None:
    """The first kind that the palm asks in this way, by name; None where there is none."""
    kinds = FINGERTIPS.items()
    return next((name for name, kind in kinds if isinstance(kind, PalmKind) and kind.tactile == tactile), None)


def as_palm_kind(name: str) -> PalmKind[Any]:
    """The kind of this name, which sends through the palm."""
    kind = FINGERTIPS[name]
    assert isinstance(kind, PalmKind), f"{name} fingertips have their own transports"
    return kind
