"""What other placings that may be right add to the covariances of poses.

A covariance of poses and faces at a solution knows nothing of another one. Where a grasp may as well be two centimetres
further along a face, its pose is uncertain by that, and the frame in which all grasps agree by a share of it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tactile_lab.slam.doubt.rivals import displaced
from tactile_lab.slam.doubt.status import Alternative
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap
from tactile_lab.slam.tracking.joint.pose_covariance import PoseCovariances, relative_to_frames


def spread_by(found: Sequence[Alternative], best: ContactMap) -> PoseCovariances:
    """Mean squares of how far poses are from the estimate where an alternative is right, by the probabilities of these.

    Args:
        found: alternatives.
        best: the estimate.
    """
    count, size = len(best.placed), best.space.size
    spread = PoseCovariances(np.zeros((count, size, size)), np.zeros((count, size, size)))
    born, centred = relative_to_frames(best)
    for one in found:
        away = best.space.deviation(displaced(best, one).rows, best.rows).ravel()
        for added, seen in ((spread.birth, born), (spread.common, centred)):
            each = (seen @ away).reshape(count, size)
            added += one.probability * each[:, :, None] * each[:, None, :]
    return spread
