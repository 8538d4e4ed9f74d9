"""Contact properties of the simulated rig's surfaces: friction, stiffness, and which kinds collide."""

from __future__ import annotations

from typing import Any, NamedTuple

HAND, TIP, OBJECT, TABLE, FOOT = 1, 2, 4, 8, 16
"""Collision classes, one bit each: the hand touches objects, on the table stands what has a foot."""


class Surface(NamedTuple):
    """Friction (slide, twist, roll), stiffness and priority of one kind of surface."""

    friction: tuple[float, float, float]
    solref: tuple[float, float]
    solimp: tuple[float, float, float, float, float]
    priority: int = 0


RUBBER = Surface((0.9, 0.003, 1e-4), (0.010, 1.0), (0.50, 0.90, 0.002, 0.5, 2.0), priority=2)  # stiffer ones chatter
GLASS = Surface((0.35, 0.005, 0.002), (0.006, 1.0), (0.95, 0.99, 0.0005, 0.5, 2.0), priority=1)
WOOD = Surface((0.5, 0.003, 1e-4), (0.004, 1.0), (0.95, 0.99, 0.0005, 0.5, 2.0))


def surface(contact: Surface, kind: int, touches: int) -> dict[str, Any]:
    """Geometry attributes of a surface of one collision class that collides with others."""
    return {
        "friction": contact.friction,
        "solref": contact.solref,
        "solimp": contact.solimp,
        "priority": contact.priority,
        "contype": kind,
        "conaffinity": touches,
    }
