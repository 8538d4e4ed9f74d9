"""The hand as lines: computes its bones from the recorded frames (palm and fingertips)."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise

import numpy as np
from gtsam import Pose3

from drivers.core.contacts import FINGERS, Array
from drivers.shadow.model.hand_form import RIGHT_HAND, HandForm
from drivers.shadow.model.motors import DRIVEN_JOINTS

TIP_CENTRE_m = np.array([0.0, 0.0, 0.019])
"""Middle of a fingertip in its distal frame."""
_KNUCKLES_m = {
    "FF": (0.033, 0.0, 0.095),
    "MF": (0.011, 0.0, 0.099),
    "RF": (-0.011, 0.0, 0.095),
    "LF": (-0.033, 0.0, 0.0865),
    "TH": (0.034, -0.0085, 0.029),
}
"""Base of the fingers in the palm frame (Shadow's hand description; the little finger's palm joint at 0)."""
_BONES_m = {"TH": (0.038, 0.032)}
_LONG_BONES_m = (0.045, 0.025)


def shown_form(world_T_palm: Pose3 | None, world_T_distal: Mapping[str, Pose3]) -> HandForm:
    """Which hand the frames show: the fingers that have one, and the side on which the first finger is."""
    if world_T_palm is None or not world_T_distal:
        return RIGHT_HAND
    driven = tuple(name for name in DRIVEN_JOINTS if name[:2] in (*world_T_distal, "WR"))
    places_m = {finger: world_T_palm.transformTo(pose.translation()) for finger, pose in world_T_distal.items()}
    is_left = {"FF", "RF"} <= set(places_m) and places_m["FF"][0] < places_m["RF"][0]
    return HandForm("left" if is_left else "right", driven)


def bones(world_T_palm: Pose3, world_T_distal: Mapping[str, Pose3]) -> Array:
    """The bones of the fingers with known frames, shape (n, 2, 3): three per finger, from the knuckle to the tip.

    The joint between the first two follows from their lengths; it is on the back of the hand. The thumb's base rotation
    cannot be derived from its tip, so that its joint is drawn approximately.
    """
    found = []
    side = np.array([-1.0 if shown_form(world_T_palm, world_T_distal).is_left else 1.0, 1.0, 1.0])
    for finger in FINGERS:
        pose = world_T_distal.get(finger)
        if pose is None:
            continue
        knuckle_m = np.asarray(world_T_palm.transformFrom(side * np.array(_KNUCKLES_m[finger])))
        chain = [knuckle_m, _elbow(knuckle_m, pose, *_BONES_m.get(finger, _LONG_BONES_m))]
        chain += [np.asarray(pose.translation()), np.asarray(pose.transformFrom(TIP_CENTRE_m))]
        found += [np.stack(ends) for ends in pairwise(chain)]
    return np.array(found).reshape(-1, 2, 3)


def _elbow(knuckle_m: Array, distal: Pose3, first_m: float, second_m: float) -> Array:
    """Where two bones meet, in the plane across the distal joint's axis."""
    way_m = np.asarray(distal.translation()) - knuckle_m
    length_m = float(np.linalg.norm(way_m))
    along_m = (length_m**2 + first_m**2 - second_m**2) / (2.0 * length_m)
    back = np.cross(way_m / length_m, distal.rotation().matrix()[:, 0])
    return np.asarray(knuckle_m + along_m * way_m / length_m + np.sqrt(max(0.0, first_m**2 - along_m**2)) * back)
