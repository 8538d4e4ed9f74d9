"""Tactile SLAM in the laboratory: shape and pose of an unknown object from a few fingertip contacts.

As a library: ``from tactile_lab import Contact, Grasp, TactileSlam``; docs/estimator.md says what it does.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from drivers.core.contacts import ApproachPath, Contact, Grasp
    from tactile_lab.slam.result import SlamResult, SlamStep
    from tactile_lab.slam.tactile_slam import SlamSettings, TactileSlam

__all__ = ["ApproachPath", "Contact", "Grasp", "SlamResult", "SlamSettings", "SlamStep", "TactileSlam"]

_PLACES = {
    "ApproachPath": "drivers.core.contacts",
    "Contact": "drivers.core.contacts",
    "Grasp": "drivers.core.contacts",
    "SlamResult": "tactile_lab.slam.result",
    "SlamSettings": "tactile_lab.slam.tactile_slam",
    "SlamStep": "tactile_lab.slam.result",
    "TactileSlam": "tactile_lab.slam.tactile_slam",
}


def __getattr__(name: str) -> Any:
    """Loaded when first asked for: the command line imports this package too, and answers ``--help`` at once."""
    if name not in _PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_PLACES[name]), name)
