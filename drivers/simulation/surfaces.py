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

_LINK_s = 0.02
"""Time constant of the hand's links, the engine's default; it takes the mean of both that touch."""


def skin_surfaces(at_once: float) -> tuple[Surface, Surface]:
    """Rubber and wood as they touch on a skin where so many pieces are touched at once, see
    :func:`drivers.simulation.skin.pieces_at_once`: each is softer, all together are as soft as one body.
    """
    softer = 1.0 + (at_once - 1.0) / 8.0  # fitted to how deep a fingertip sinks in at 1 N (decision 103)
    rubber_s, wood_s = softer * RUBBER.solref[0], softer * (WOOD.solref[0] + _LINK_s) - _LINK_s
    return RUBBER._replace(solref=(rubber_s, 1.0)), WOOD._replace(solref=(wood_s, 1.0))


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
