"""Tactile SLAM in the laboratory: shape and pose of an unknown object from a few fingertip contacts.

As a library: ``from tactile_lab import Contact, Grasp, TactileSlam``. What is public is what this module lists, page
docs/library.md describes; everything else may change in any version. docs/estimator.md says what the estimation does.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from tactile_lab.own_packages import check_own_packages

check_own_packages()

if TYPE_CHECKING:
    from drivers.core.contacts import ApproachPath, Contact, Grasp
    from drivers.core.errors import (
        ConfigurationError,
        DeviceError,
        EstimationError,
        InterruptionError,
        SafetyError,
        SessionError,
        ShapeError,
        TactileLabError,
        TrackingError,
        WriteError,
    )
    from drivers.fingertips.kinds import FINGERTIPS, WIRES
    from drivers.positioner.kinds import POSITIONERS
    from sessions.exchange.contact_log import ContactLog, read_contact_log, write_contact_log
    from sessions.recording.listing import find_session
    from sessions.recording.session import Session
    from tactile_lab.evaluation.evaluation import Evaluation
    from tactile_lab.evaluation.figures import FIGURES
    from tactile_lab.evaluation.files.results import read_results
    from tactile_lab.evaluation.files.tables import read_contour
    from tactile_lab.report.outlines import OutlinePicture
    from tactile_lab.slam.exploration.policies import POLICIES
    from tactile_lab.slam.exploration.policy import Belief, Decision, best_of, nothing_to_choose
    from tactile_lab.slam.result import SlamResult, SlamStep
    from tactile_lab.slam.shape.selection.models import SHAPE_MODELS
    from tactile_lab.slam.shape.surfaces.surface import Contour, SurfaceMesh
    from tactile_lab.slam.slam_settings import SlamSettings
    from tactile_lab.slam.tactile_slam import TactileSlam
    from tactile_lab.slam.tracking.tracker import Tracker
    from tactile_lab.slam.tracking.trackers import METHODS, TrackerStart
    from tactile_lab.workflow.exporters import EXPORTERS
    from tactile_lab.workflow.finishing import FinishedSession
    from tactile_lab.workflow.reconstructing import Wishes, reconstruct

    __version__: str

_PLACES = {
    "ApproachPath": "drivers.core.contacts",
    "Belief": "tactile_lab.slam.exploration.policy",
    "ConfigurationError": "drivers.core.errors",
    "Contact": "drivers.core.contacts",
    "ContactLog": "sessions.exchange.contact_log",
    "Contour": "tactile_lab.slam.shape.surfaces.surface",
    "Decision": "tactile_lab.slam.exploration.policy",
    "DeviceError": "drivers.core.errors",
    "EXPORTERS": "tactile_lab.workflow.exporters",
    "EstimationError": "drivers.core.errors",
    "Evaluation": "tactile_lab.evaluation.evaluation",
    "FIGURES": "tactile_lab.evaluation.figures",
    "FINGERTIPS": "drivers.fingertips.kinds",
    "FinishedSession": "tactile_lab.workflow.finishing",
    "Grasp": "drivers.core.contacts",
    "InterruptionError": "drivers.core.errors",
    "METHODS": "tactile_lab.slam.tracking.trackers",
    "OutlinePicture": "tactile_lab.report.outlines",
    "POLICIES": "tactile_lab.slam.exploration.policies",
    "POSITIONERS": "drivers.positioner.kinds",
    "SHAPE_MODELS": "tactile_lab.slam.shape.selection.models",
    "SafetyError": "drivers.core.errors",
    "Session": "sessions.recording.session",
    "SessionError": "drivers.core.errors",
    "ShapeError": "drivers.core.errors",
    "SlamResult": "tactile_lab.slam.result",
    "SlamSettings": "tactile_lab.slam.tactile_slam",
    "SlamStep": "tactile_lab.slam.result",
    "SurfaceMesh": "tactile_lab.slam.shape.surfaces.surface",
    "TactileLabError": "drivers.core.errors",
    "TactileSlam": "tactile_lab.slam.tactile_slam",
    "Tracker": "tactile_lab.slam.tracking.tracker",
    "TrackerStart": "tactile_lab.slam.tracking.trackers",
    "TrackingError": "drivers.core.errors",
    "WIRES": "drivers.fingertips.kinds",
    "Wishes": "tactile_lab.workflow.reconstructing",
    "WriteError": "drivers.core.errors",
    "best_of": "tactile_lab.slam.exploration.policy",
    "find_session": "sessions.recording.listing",
    "nothing_to_choose": "tactile_lab.slam.exploration.policy",
    "read_contour": "tactile_lab.evaluation.files.tables",
    "read_contact_log": "sessions.exchange.contact_log",
    "read_results": "tactile_lab.evaluation.files.results",
    "reconstruct": "tactile_lab.workflow.reconstructing",
    "write_contact_log": "sessions.exchange.contact_log",
}

__all__ = [
    "EXPORTERS",
    "FIGURES",
    "FINGERTIPS",
    "METHODS",
    "POLICIES",
    "POSITIONERS",
    "SHAPE_MODELS",
    "WIRES",
    "ApproachPath",
    "Belief",
    "ConfigurationError",
    "Contact",
    "ContactLog",
    "Contour",
    "Decision",
    "DeviceError",
    "EstimationError",
    "Evaluation",
    "FinishedSession",
    "Grasp",
    "InterruptionError",
    "OutlinePicture",
    "SafetyError",
    "Session",
    "SessionError",
    "ShapeError",
    "SlamResult",
    "SlamSettings",
    "SlamStep",
    "SurfaceMesh",
    "TactileLabError",
    "TactileSlam",
    "Tracker",
    "TrackerStart",
    "TrackingError",
    "Wishes",
    "WriteError",
    "__version__",
    "best_of",
    "find_session",
    "nothing_to_choose",
    "read_contact_log",
    "read_contour",
    "read_results",
    "reconstruct",
    "write_contact_log",
]


def __getattr__(name: str) -> Any:
    """Loaded when first asked for: the command line imports this package too, and answers ``--help`` at once."""
    if name == "__version__":
        return import_module("importlib.metadata").version("tactile-lab")
    if name not in _PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_PLACES[name]), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
