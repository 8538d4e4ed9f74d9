"""What can be said about a session's object before the hand moves: whether it fits the rig, and whether the camera sees
its marker.
"""

from __future__ import annotations

from drivers.camera.aruco import ObjectTracker
from drivers.camera.calibration import load_camera
from drivers.camera.frames import Frame
from drivers.camera.markers import MarkerSettings
from drivers.core.errors import ConfigurationError, DeviceError
from drivers.simulation.objects import object_height_m
from sessions.rig_runtime.rig_runtime import RigRuntime
from tactile_lab.rigs.description import Rig

_MORE_PICTURES = 4
"""After one without the marker: a small one is seen now and then."""


def check_fits(rig: Rig, object_name: str) -> None:
    """Refuse an object of known shape that the hand would run into on its way, or that it cannot feel.

    Raises:
        ConfigurationError: no such object, its mesh cannot be used, or it is too tall or too low for the rig.
    """
    height_m, settings = object_height_m(object_name), rig.description.conductor
    highest_m, lowest_m = settings.probing.highest_m, settings.cycle.touch.lowest_m
    if settings.probing.top and height_m > highest_m:
        what = f"stands {_mm(height_m)} high, and the hand travels no higher than {_mm(highest_m)} above the table"
        hint = (
            "Lay it down (--pose lying), or raise conductor.probing.highest_m in the rig file if the arm reaches so far"
        )
        raise ConfigurationError(what, where=object_name, hint=hint)
    if height_m < lowest_m:
        what = f"is only {_mm(height_m)} high as it lies, and fingertips feel nothing lower than {_mm(lowest_m)}"
        raise ConfigurationError(what, where=object_name, hint="Set it on another side (--pose standing, or --pose N)")


def marker_problem(runtime: RigRuntime, rig: Rig, markers: MarkerSettings) -> str:
    """Why grasps of the session would have no true pose, as a sentence, by pictures taken now; empty where they will.

    Args:
        runtime: connected.
        rig: what was calibrated.
        markers: of the rig with this object.
    """
    if runtime.camera is None or "camera" not in rig.files:
        return ""
    tracker = ObjectTracker(load_camera(rig.files["camera"]), markers)
    try:
        if not (problem := _unseen(runtime, tracker)):
            return ""
        seen = [_unseen(runtime, tracker) for _ in range(_MORE_PICTURES)].count("")
    except DeviceError as error:
        return f"the camera gave no picture before the first grasp: {error}"
    return f"{_how_often(seen, problem)}. The marker under the object has a side of {_mm(markers.object_side_m)}: " + (
        "use a larger one, bring it into the picture, or clean the table"
    )


def _unseen(runtime: RigRuntime, tracker: ObjectTracker) -> str:
    """Why a picture does not show where the object is; empty if it does. Raises DeviceError."""
    picture = runtime.picture()
    assert isinstance(picture, Frame)
    return tracker.observe(picture).problem


def _how_often(seen: int, problem: str) -> str:
    if seen == 0:
        return f"the camera cannot locate the object: {problem}. Grasps made like this have no true pose"
    shown = f"in {seen} of {_MORE_PICTURES + 1} pictures: {problem} in the others"
    return f"the camera locates the object {shown}. Some grasps may have no true pose"


def _mm(length_m: float) -> str:
    return f"{1e3 * length_m:.0f} mm"
