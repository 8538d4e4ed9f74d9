"""A hand that executes planned grasps on a known outline in the plane, imprecisely, and measures with noise.

The setting of the thesis's section 4.5.2: five fingers on a fan around the palm close along straight lines. Standard
deviations of the execution: 3 mm and 3 degrees for the palm, 2 degrees for each finger's base, and 2 mm for its aim.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from gtsam import Pose2

from drivers.core.contacts import FINGERS, ApproachPath, Array, Contact, Grasp
from drivers.core.poses import spatial
from tactile_lab.experiments.data.outlines import first_crossing
from tactile_lab.experiments.data.sensing import IN_PLANE, line_to_contact, measured_contact, planar_pose
from tactile_lab.slam.exploration.candidates import ClosingRays

FAN_rad = np.deg2rad([-75.0, -25.0, 25.0, 75.0, 180.0])
AIM_m = np.array([[-0.006, -0.006], [0.0, -0.004], [0.0, 0.004], [-0.006, 0.006], [0.0, 0.0]])
REACH_m = 0.120
PALM_SIGMAS = np.array([0.003, 0.003, np.deg2rad(3.0)])
FAN_SIGMA_rad = float(np.deg2rad(2.0))
AIM_SIGMA_m = 0.002
PALM_HEIGHT_m = 0.15


def planned_rays() -> ClosingRays:
    """The planned paths of the fingers, in the grasp frame."""
    starts, ways = _ways(FAN_rad, AIM_m)
    return ClosingRays(
        FINGERS, np.pad(starts, ((0, 0), (0, 1))), np.pad(ways, ((0, 0), (0, 1))), np.full(5, 2 * REACH_m)
    )


@dataclass
class PlanarHand:
    """Executes grasps on an outline.

    Attributes:
        outline_m: true outline in body coordinates, counter-clockwise, shape (n, 2).
        rng: random numbers of execution and measurement.
    """

    outline_m: Array
    rng: np.random.Generator

    def grasp(self, index: int, world_T_palm: Pose2, world_T_body: Pose2) -> Grasp:
        """Send the palm to a pose and close the fingers on the object."""
        reached = world_T_palm.compose(Pose2(*(PALM_SIGMAS * self.rng.normal(size=3))))
        starts, ways = _ways(
            FAN_rad + self.rng.normal(0.0, FAN_SIGMA_rad, 5), AIM_m + self.rng.normal(0.0, AIM_SIGMA_m, (5, 2))
        )
        found = [
            self._close(finger, reached, start, way, world_T_body)
            for finger, start, way in zip(FINGERS, starts, ways, strict=True)
        ]
        contacts = tuple(contact for contact, _ in found if contact is not None)
        pose = spatial(reached, PALM_HEIGHT_m)
        return Grasp(index, index * 10**9, contacts, pose, approach_paths=tuple(line for _, line in found))

    def _close(
        self, finger: str, palm: Pose2, start_m: Array, way: Array, world_T_body: Pose2
    ) -> tuple[Contact | None, ApproachPath]:
        body_T_palm = world_T_body.between(palm).matrix()
        turned = body_T_palm[:2, :2] @ way
        hit = first_crossing(self.outline_m, body_T_palm[:2, :2] @ start_m + body_T_palm[:2, 2], turned, 2 * REACH_m)
        start_world_m = np.append(palm.transformFrom(start_m), 0.0)
        if hit is None:
            end_m = np.append(palm.transformFrom(start_m + 2 * REACH_m * way), 0.0)
            return None, ApproachPath(finger, start_world_m, end_m, touched=False)
        point, normal = (np.append(value, 0.0) for value in hit)
        contact = measured_contact(finger, point, normal, spatial(world_T_body), self.rng, axes=IN_PLANE)
        return contact, line_to_contact(start_world_m, contact)


def slip(world_T_body: Pose2, body_T_frame: Pose2, sigmas: Array, rng: np.random.Generator) -> Pose2:
    """The object's pose after a push by the fingers: moved, and rotated about the origin of the tracked frame."""
    push = sigmas * rng.normal(size=3)
    frame = world_T_body.compose(body_T_frame)
    moved = planar_pose(np.array([frame.x() + push[0], frame.y() + push[1]]), frame.theta() + float(push[2]))
    return moved.compose(body_T_frame.inverse())


def _ways(fan_rad: Array, aim_m: Array) -> tuple[Array, Array]:
    """Start points and unit directions in the grasp frame, each of shape (5, 2)."""
    starts = REACH_m * np.column_stack([np.cos(fan_rad), np.sin(fan_rad)])
    ways = aim_m - starts
    return starts, ways / np.linalg.norm(ways, axis=1, keepdims=True)
