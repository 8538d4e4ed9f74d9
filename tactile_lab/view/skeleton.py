"""The hand as lines: computes its bones from the recorded frames (palm and fingertips)."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise

import numpy as np
from gtsam import Pose3

from drivers.core.contacts import FINGERS, Array

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


def bones(world_T_palm: Pose3, world_T_distal: Mapping[str, Pose3]) -> Array:
    """The bones of the fingers with known frames, shape (n, 2, 3): three per finger, from the knuckle to the tip.

    The joint between the first two follows from their lengths; it is on the back of the hand. The thumb's base rotation
    cannot be derived from its tip, so that its joint is drawn approximately.
    """
    found = []
    for finger in FINGERS:
        pose = world_T_distal.get(finger)
        if pose is None:
            continue
        knuckle_m = np.asarray(world_T_palm.transformFrom(np.array(_KNUCKLES_m[finger])))
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
