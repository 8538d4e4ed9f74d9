"""The moving part of the simulated rig: steps the physics, takes duty cycles and base targets, returns true
quantities.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from gtsam import Pose2, Pose3, Rot3
from numpy.typing import NDArray

from drivers.core.clock import NANOSECONDS
from drivers.core.contacts import FINGERS, Array
from drivers.core.installed.extras import LazyPackage
from drivers.shadow.model.hand_form import RIGHT_HAND, HandForm
from drivers.shadow.model.kinematics import JOINT_INDEX, JOINTS, joint_vector
from drivers.shadow.model.motors import DRIVEN_JOINTS
from drivers.simulation.hand_plant import TrueContact
from drivers.simulation.model import BASE_JOINTS, BASE_LIMITS, TIMESTEP_s

if TYPE_CHECKING:
    import mujoco
else:
    mujoco = LazyPackage("mujoco")

STEP_ns = round(TIMESTEP_s * NANOSECONDS)
START_BASE = np.array([-0.32, 0.0, 0.36, 0.0, 0.0, 0.0])
"""Initial position of the positioner: the hand is open, flat and well above the middle of the table."""

_BASE_LOWEST, _BASE_HIGHEST = BASE_LIMITS.T
_START_HAND_rad = {"THJ5": 0.9, "THJ4": 1.0}  # thumb turned to the side of the palm, fingers straight


class Plant:
    """The physics with its clock.

    Args:
        model: from :func:`drivers.simulation.model.build_model`.
        start: initial pose of the object: position of its frame's origin and its rotation on the table.
        form: of the model's hand. Arrays have the places of a full hand; what this one lacks reads zero.
    """

    def __init__(self, model: mujoco.MjModel, start: Pose2, form: HandForm = RIGHT_HAND) -> None:
        self._model, self._data = model, mujoco.MjData(model)
        self._steps = 0
        self._joints = _addresses(model, form.joints)
        self._joint_places = [JOINT_INDEX[name] for name in form.joints]
        self._base = _addresses(model, BASE_JOINTS)
        self._motors = np.array([model.actuator(name).id for name in form.driven])
        self._motor_places = [DRIVEN_JOINTS.index(name) for name in form.driven]
        self._servos = np.array([model.actuator(name).id for name in BASE_JOINTS])
        self._finger_places = [FINGERS.index(finger) for finger in form.fingers]
        self._wrench = _sensor_addresses(model, form.fingers)
        self._distal = {finger: model.site(f"{finger} distal").id for finger in form.fingers}
        self._tips = {model.geom(f"{finger} tip").id: finger for finger in form.fingers}
        self._table = model.geom("table").id
        self._object, self._palm = model.body("object").id, model.body("WRJ1").id
        self._place(start)

    def _place(self, start: Pose2) -> None:
        data, address = self._data, self._model.joint("object").qposadr[0]
        data.qpos[address : address + 2] = start.x(), start.y()
        data.qpos[address + 3 : address + 7] = np.cos(start.theta() / 2), 0, 0, np.sin(start.theta() / 2)
        data.qpos[self._base] = START_BASE
        data.ctrl[self._servos] = START_BASE
        self.pose_hand(joint_vector(_START_HAND_rad))

    def pose_hand(self, joints_rad: Array) -> None:
        """Put the hand into a posture at once, shape (24,), without advancing time."""
        self._data.qpos[self._joints] = joints_rad[self._joint_places]
        mujoco.mj_forward(self._model, self._data)

    @property
    def stamp_ns(self) -> int:
        """Simulated time since the beginning."""
        return self._steps * STEP_ns

    def settle(self, duration_s: float) -> None:
        """Let the object come to rest before time begins."""
        mujoco.mj_step(self._model, self._data, round(duration_s / TIMESTEP_s))

    def advance(self, steps: int) -> None:
        """Advance time by a number of physics steps with the present duties and targets."""
        if steps:
            mujoco.mj_step(self._model, self._data, steps)
            self._steps += steps

    def drive(self, duty: Array) -> None:
        """Set the duty of each motor, shape (20,), -1 to 1, order of :data:`DRIVEN_JOINTS`."""
        self._data.ctrl[self._motors] = np.minimum(np.maximum(duty[self._motor_places], -1.0), 1.0)

    def move_base(self, target: Array) -> None:
        """Set the positioner's targets, shape (6,), metres and radians; clipped to its range."""
        self._data.ctrl[self._servos] = np.minimum(np.maximum(target, _BASE_LOWEST), _BASE_HIGHEST)

    @property
    def joints_rad(self) -> Array:
        """True joint angles, shape (24,), order of :data:`~drivers.shadow.model.kinematics.JOINTS`."""
        joints_rad = np.zeros(len(JOINTS))
        joints_rad[self._joint_places] = self._data.qpos[self._joints]
        return joints_rad

    @property
    def base(self) -> Array:
        """True positioner joints, shape (6,), metres and radians."""
        return np.asarray(self._data.qpos[self._base])

    @property
    def motor_torque_Nm(self) -> Array:
        """Torque that each motor exerts on its joint, shape (20,), order of :data:`DRIVEN_JOINTS`."""
        torque_Nm = np.zeros(len(DRIVEN_JOINTS))
        torque_Nm[self._motor_places] = self._data.actuator_force[self._motors]
        return torque_Nm

    @property
    def wrenches(self) -> Array:
        """Load on the five fingertips, shape (5, 6): force and moment about the sensor's origin, sensor frames.

        Includes the tip's own weight and inertia. The engine reports the load of the tip on the link with the opposite
        sign.
        """
        wrenches = np.zeros((len(FINGERS), 6))
        wrenches[self._finger_places] = -self._data.sensordata[self._wrench]
        return wrenches

    def world_T_distal(self, finger: str) -> Pose3:
        """True pose of a finger's distal frame; the world's for a finger that is not there."""
        if (site := self._distal.get(finger)) is None:
            return Pose3()
        return Pose3(Rot3(self._data.site_xmat[site].reshape(3, 3)), self._data.site_xpos[site])

    @property
    def world_T_palm(self) -> Pose3:
        """True pose of the palm frame."""
        return Pose3(Rot3(self._data.xmat[self._palm].reshape(3, 3)), self._data.xpos[self._palm])

    @property
    def world_T_object(self) -> Pose3:
        """True pose of the object frame."""
        rotation = self._data.xmat[self._object].reshape(3, 3)
        return Pose3(Rot3(rotation), self._data.xpos[self._object])

    def contacts(self) -> tuple[TrueContact, ...]:
        """All present contacts of fingertips. One touch may give several of the engine's contact points."""
        found = [self._contact(index) for index in range(self._data.ncon)]
        return tuple(contact for contact in found if contact is not None)

    def link_loads_N(self) -> dict[str, float]:
        """Force of the object on each link of the hand without a sensor, by its name; those that it touches."""
        forces_N: dict[str, Array] = {}
        for index in range(self._data.ncon):
            pair = [int(geometry) for geometry in self._data.contact[index].geom]
            bodies = [int(self._model.geom_bodyid[geometry]) for geometry in pair]
            others = [g for g, body in zip(pair, bodies, strict=True) if body != self._object]
            if len(others) != 1 or others[0] in self._tips or others[0] == self._table:
                continue
            link = self._model.body(self._model.geom_bodyid[others[0]]).name
            towards_link = 1.0 if others[0] == pair[1] else -1.0
            forces_N[link] = forces_N.get(link, np.zeros(3)) + towards_link * self._force_world_N(index)
        return {link: float(np.linalg.norm(force)) for link, force in forces_N.items()}

    def _force_world_N(self, index: int) -> Array:
        """Force of the first geometry of a contact on the second, shape (3,)."""
        wrench = np.zeros(6)
        mujoco.mj_contactForce(self._model, self._data, index, wrench)
        return np.asarray(wrench[:3] @ self._data.contact[index].frame.reshape(3, 3))

    def _contact(self, index: int) -> TrueContact | None:
        contact = self._data.contact[index]
        first, second = int(contact.geom[0]), int(contact.geom[1])
        tip, other = (first, second) if first in self._tips else (second, first)
        if tip not in self._tips:
            return None
        frame = contact.frame.reshape(3, 3)  # rows: normal from the first to the second geometry, two tangents
        towards_tip = 1.0 if tip == second else -1.0
        return TrueContact(
            finger=self._tips[tip],
            touched="table" if other == self._table else "object",
            point_world_m=contact.pos.copy(),
            normal_world=towards_tip * frame[0],
            force_on_tip_world_N=towards_tip * self._force_world_N(index),
            slides_m_s=self._slides_m_s(first, second, contact.pos, frame[1:]),
        )

    def _slides_m_s(self, first: int, second: int, point_m: Array, tangents: Array) -> float:
        """Speed of one geometry's surface along the other's at a point of both."""
        one, other = (self._velocity_m_s(geometry, point_m) for geometry in (first, second))
        return float(np.linalg.norm(tangents @ (other - one)))

    def _velocity_m_s(self, geometry: int, point_m: Array) -> Array:
        """Velocity of the place of a geometry that is at a point now, shape (3,)."""
        velocity = np.zeros(6)
        mujoco.mj_objectVelocity(self._model, self._data, mujoco.mjtObj.mjOBJ_GEOM, geometry, velocity, 0)
        return np.asarray(velocity[3:] + np.cross(velocity[:3], point_m - self._data.geom_xpos[geometry]))


def _addresses(model: mujoco.MjModel, joints: Sequence[str]) -> NDArray[np.intp]:
    return np.array([model.joint(name).qposadr[0] for name in joints])


def _sensor_addresses(model: mujoco.MjModel, fingers: Sequence[str]) -> NDArray[np.intp]:
    starts = [[model.sensor(f"{finger} {kind}").adr[0] for kind in ("force", "moment")] for finger in fingers]
    return np.array([[start + axis for start in pair for axis in range(3)] for pair in starts])
