"""What will become of an object that is about to be carried: whether it slips, and whether only the fingers keep it up.

The same balance of friction that follows a carry predicts one: of fingertips that stay where they are in the hand,
press with the forces that are intended, and yield where the object presses back, as force control lets them. It tells
what the fingers cannot hold, not the few millimetres by which fingers that are moved always drag the object.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from gtsam import Pose2

from drivers.core.contacts import FINGERS, Array, Contact
from sessions.perception.carrying.friction_balance import Balance, Friction, compose_steps
from sessions.perception.carrying.planar_motions import displacements, planar_matrices
from sessions.perception.carrying.tip_steps import TipSteps

_STEPS, _ITERATIONS = 25, 12
_SLIPS_m, _SLIPS_rad = 0.004, float(np.deg2rad(5.0))
"""As far as a slip that a person hears of when it has happened."""


@dataclass(frozen=True)
class Forecast:
    """What a carry will do to an object.

    Attributes:
        force_N: of each finger that holds it; the thumb holds against their sum.
        slip_m, slip_rad: how far it will slip.
        leans: it would tip over if it were pushed at the height of the fingertips: only their friction keeps it up.
    """

    force_N: float
    slip_m: float
    slip_rad: float
    leans: bool

    @property
    def slips(self) -> bool:
        """Whether it will slip farther than usual."""
        return self.slip_m > _SLIPS_m or self.slip_rad > _SLIPS_rad

    def in_words(self) -> str:
        """What to tell before the carry; "" where nothing is to be expected."""
        told = []
        if self.slips:
            far = f"{1e3 * self.slip_m:.0f} mm, {np.degrees(self.slip_rad):.0f} degrees"
            told.append(f"will slip by about {far}: the fingers cannot hold it against the table's friction")
        if self.leans:
            told.append("would tip over without the fingers' friction")
        return "; ".join(told)


@dataclass(frozen=True)
class IntendedCarry:
    """A carry that is about to begin.

    Attributes:
        contacts: of the fingertips that hold the object.
        palm: poses of the palm's frame on the table from the beginning to the end.
        duration_s: of the motion.
        yielding_m_s_N: speed at which a fingertip yields, for each newton by which it is pressed more than intended.
    """

    contacts: Sequence[Contact]
    palm: Sequence[Pose2]
    duration_s: float
    yielding_m_s_N: float

    @classmethod
    def of(
        cls, contacts: Sequence[Contact], about: Pose2, end: Pose2, duration_s: float, yielding_m_s_N: float
    ) -> IntendedCarry:
        """The hand turns evenly about its frame while that moves along a straight line."""
        turn = about.between(end).theta()
        places_m = np.linspace([about.x(), about.y()], [end.x(), end.y()], _STEPS + 1)
        turns_rad = about.theta() + turn * np.linspace(0.0, 1.0, _STEPS + 1)
        poses = [Pose2(float(x), float(y), float(yaw)) for (x, y), yaw in zip(places_m, turns_rad, strict=True)]
        return cls(contacts, poses, duration_s, yielding_m_s_N)

    def forecast(self, force_N: float, forces_N: Mapping[str, float], friction: Friction, weight_N: float) -> Forecast:
        """What will become of the object.

        Args:
            force_N: what each finger is told.
            forces_N: normal forces, by finger.
            friction: of fingertips and table, and the object's foot.
            weight_N: of the object; NaN if it is not known.
        """
        steps = self._steps(forces_N)
        balance = Balance.of(steps)
        hardness = 1.0 / (2 * self.yielding_m_s_N * steps.step_s[0] * max(np.mean(list(forces_N.values())), 1e-3))
        yielding = replace(friction, normal_weight=float(hardness))
        motion = compose_steps(balance.solve([yielding], _ITERATIONS), balance.centres_m)[0]
        palm = planar_matrices(steps.world_T_palm[[0, -1]])[0]
        slip = displacements(np.linalg.inv(palm) @ motion, balance.centres_m[0])
        height_m = float(np.mean([contact.point_world_m[2] for contact in self.contacts]))
        leans = friction.table_N * height_m > weight_N * friction.half_width_m
        return Forecast(force_N, float(np.hypot(*slip[:2])), float(abs(slip[2])), bool(leans))

    def _steps(self, forces_N: Mapping[str, float]) -> TipSteps:
        """Fingertips that move with the palm."""
        count, fingers = len(self.palm) - 1, len(FINGERS)
        points, normals, forces = (
            np.zeros((count + 1, fingers, 3)),
            np.zeros((count + 1, fingers, 3)),
            np.zeros(fingers),
        )
        frames = np.array([_upright(pose) for pose in self.palm])
        moves = frames @ np.linalg.inv(frames[0])
        for contact in self.contacts:
            at = FINGERS.index(contact.finger)
            points[:, at] = moves[:, :3, :3] @ contact.point_world_m + moves[:, :3, 3]
            normals[:, at] = moves[:, :3, :3] @ contact.normal_world
            forces[at] = forces_N.get(contact.finger, 0.0)
        still, shape = np.zeros((count, fingers)), (count, fingers)
        middle = normals[1:] + normals[:-1]
        return TipSteps(
            points_m=(points[1:] + points[:-1]) / 2,
            normals=middle / np.maximum(np.linalg.norm(middle, axis=-1, keepdims=True), 1e-12),
            moves_m=points[1:] - points[:-1],
            forces_N=np.broadcast_to(forces, shape),
            sinking=still,
            tangential_N=still,
            net_forces_N=np.zeros((count, 3)),
            moments_Nm=np.zeros(count),
            levers_m=np.zeros(count),
            is_void=np.zeros(shape, dtype=bool),
            world_T_palm=frames,
            step_s=np.full(count, self.duration_s / count),
        )


def _upright(pose: Pose2) -> Array:
    matrix, planar = np.eye(4), pose.matrix()
    matrix[:2, :2], matrix[:2, 3] = planar[:2, :2], planar[:2, 2]
    return matrix
