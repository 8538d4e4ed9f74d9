"""Sessions in which the hand carries the object after every grasp, estimated with and without odometry in the hand.

One session serves both: its grasps either move with the object as the fingertips felt it, or with the palm, at the
rig's usual noise. The fixed rule plans the grasps, so that the estimation has no part in them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from gtsam import Pose2, Pose3

from drivers.core.contacts import Grasp
from drivers.core.poses import planar
from tactile_lab.evaluation.registration import FAILURE_LIMIT_MM
from tactile_lab.experiments.cells import Cell
from tactile_lab.experiments.thesis.rig_sessions import RIG, RigSession, judge, record
from tactile_lab.rigs.description import load_rig
from tactile_lab.slam.tactile_slam import TactileSlam
from tactile_lab.workflow.running import slam_settings

TOUCH, PALM = "touch", "palm"
GRASPS = 12


def estimate_carried(cell: Cell) -> dict[str, Any]:
    """One session, estimated once. Cell: object, dimension, odometry, grasps."""
    dimension = int(cell["dimension"])
    session = record(str(cell["object"]), cell.seed, dimension, int(cell["grasps"]))
    slam = TactileSlam(slam_settings("joint", dimension, load_rig(RIG).description.motion), cell.seed)
    for grasp in session.grasps if cell["odometry"] == TOUCH else moved_with_the_palm(session):
        slam.add_grasp(grasp)
    found = judge(session, slam.finish())
    error_mm = found["registration_mm"]
    lost = error_mm is None or error_mm > FAILURE_LIMIT_MM
    return {**found, "lost": float(lost), **farthest_slide(session)}


def moved_with_the_palm(session: RigSession) -> Iterator[Grasp]:
    """The grasps as they are without odometry: the object moved as the palm did."""
    for grasp, motion in zip(session.grasps, session.palm_motions, strict=True):
        yield replace(grasp, hand_motion_world=motion, motion_sigma=None)


def farthest_slide(session: RigSession) -> dict[str, Any]:
    """The step in which the object slid farthest against the palm, and what odometry said of it, by places of its
    middle; None where it was never carried.
    """
    middle_m = session.mesh.center_mass[:2]
    places = [pose.transformFrom(middle_m) for pose in map(planar, session.world_T_body)]
    felt, with_palm = (
        np.array([pose.transformFrom(middle_m) for pose in _expected(session, motions)]).reshape(-1, 2)
        for motions in ([grasp.hand_motion_world for grasp in session.grasps], session.palm_motions)
    )
    true = np.array(places[1:]).reshape(-1, 2)
    slid, said, off = (np.linalg.norm(1e3 * gap, axis=1) for gap in (true - with_palm, felt - with_palm, felt - true))
    if not len(slid):
        return {"slid_mm": None, "said_mm": None, "said_off_mm": None, "said_sigma_mm": None}
    at = int(np.argmax(slid))
    sigma = session.grasps[at + 1].motion_sigma
    stated_mm = None if sigma is None else 1e3 * sigma.translation_m
    told = {"slid_mm": slid[at], "said_mm": said[at], "said_off_mm": off[at]}
    return {**{name: float(value) for name, value in told.items()}, "said_sigma_mm": stated_mm}


def _expected(session: RigSession, motions: Sequence[Pose3]) -> list[Pose2]:
    """Where the object would be at each grasp but the first if it had moved so since the one before."""
    before = map(planar, session.world_T_body[:-1])
    return [planar(motion) * pose for motion, pose in zip(motions[1:], before, strict=True)]
