"""The physics model of the simulated rig: positioner, Shadow hand, fingertips, table and object.

Built in code from primitives, without mesh files. Names inside the model: links are named after their joint (``FFJ3``
is the link behind joint FFJ3, ``WRJ1`` the palm), fingertips ``FF tip``, sensors ``FF force`` and ``FF moment``. Hand
links collide with table and object but not with each other.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from gtsam import Pose3, Rot3

from drivers.core.contacts import Array
from drivers.core.fingertip import TipBody
from drivers.core.installed.extras import LazyPackage
from drivers.shadow.model.bodies import FOREARM, LINK_SHAPES, Ball, Block, Capsule, Ellipsoid, Shape, mirror_shape
from drivers.shadow.model.hand_form import RIGHT_HAND, HandForm
from drivers.shadow.model.kinematics import JOINT_TABLE, Joint, JOINT_LIMITS_rad, joint_table
from drivers.simulation.devices.geared_motors import DISTAL_COUPLING, motor_class
from drivers.simulation.objects import Hull, ObjectModel, Piece
from drivers.simulation.surfaces import (
    FOOT,
    GLASS,
    HAND,
    OBJECT,
    RUBBER,
    TABLE,
    TIP,
    WOOD,
    surface,
)

if TYPE_CHECKING:
    import mujoco
else:
    mujoco = LazyPackage("mujoco")

TIMESTEP_s = 0.002
BASE_JOINTS = ("base x", "base y", "base z", "base yaw", "base pitch", "base roll")
"""Joints of the positioner in the order used by every base vector: metres, then radians."""

_FOREARM_QUATERNION = (0.5, 0.5, 0.5, 0.5)  # R0 = [[0, 0, 1], [1, 0, 0], [0, 1, 0]], fingers along +x at zero


class _Axis(NamedTuple):
    """One positioner joint: kind, direction, range, driven inertia."""

    slides: bool
    direction: tuple[float, float, float]
    lower: float
    upper: float
    armature: float


_BASE_AXES = (
    _Axis(True, (1, 0, 0), -1.0, 1.0, 5.0),
    _Axis(True, (0, 1, 0), -1.0, 1.0, 5.0),
    _Axis(True, (0, 0, 1), -0.3, 1.3, 5.0),
    _Axis(False, (0, 0, 1), -4 * np.pi, 4 * np.pi, 0.5),
    _Axis(False, (0, 1, 0), -1.0, 1.9, 0.5),
    _Axis(False, (1, 0, 0), -2.2, 2.2, 0.5),
)
BASE_LIMITS = np.array([[axis.lower, axis.upper] for axis in _BASE_AXES])
"""Range of each positioner joint, shape (6, 2), metres and radians."""

_BASE_BANDWIDTH_rad_s = 60.0  # stiff compared with the hand: it follows a path with a delay of 33 ms
_CARRIED_kg, _CARRIED_kg_m2 = 4.0, 0.15
_BASE_FORCE_N, _BASE_TORQUE_Nm = 400.0, 60.0
_TRAIL_Nm_rad, _TRAIL_Nms_rad = 0.25, 0.01  # elastic coupling of J1 to J2


def build_model(
    target: ObjectModel,
    object_mass_kg: float,
    tips: Mapping[str, TipBody],
    world_T_mount: Pose3,
    form: HandForm = RIGHT_HAND,
) -> mujoco.MjModel:
    """Compile the rig with one object lying at the world's origin.

    Args:
        target: the object on the table.
        object_mass_kg: its mass, spread evenly over its volume.
        tips: the fingertip of each of the hand's fingers.
        world_T_mount: pose of the positioner when its six joints are zero.
        form: of the hand; a joint that it does not have is rigid, a finger is not there.
    """
    spec = mujoco.MjSpec()
    _set_options(spec)
    _add_table(spec, rolling=target.rolls)
    forearm = _add_positioner(spec, world_T_mount)
    links = _add_links(forearm, form)
    for finger in form.fingers:
        _add_tip(spec, links[f"{finger}J1"], finger, tips[finger])
    _add_motors(spec, form)
    _add_object(spec, target, object_mass_kg)
    return spec.compile()


def _set_options(spec: Any) -> None:
    spec.compiler.degree = False
    spec.compiler.autolimits = True
    spec.option.timestep = TIMESTEP_s
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.impratio = 10


def _add_table(spec: Any, *, rolling: bool) -> None:
    spec.worldbody.add_geom(
        name="table",
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=[0.5, 0.5, 0.01],
        pos=[0, 0, -0.01],
        condim=6 if rolling else 3,  # rolling friction halves the simulation's speed, so only for objects that roll
        **surface(GLASS, TABLE, HAND | TIP | FOOT),
    )


def _add_positioner(spec: Any, world_T_mount: Pose3) -> Any:
    """The six-axis positioner; returns the forearm it carries."""
    base = _add_link(spec.worldbody, "base", world_T_mount.translation(), _quaternion(world_T_mount.rotation()))
    for name, axis in zip(BASE_JOINTS, _BASE_AXES, strict=True):
        kind = mujoco.mjtJoint.mjJNT_SLIDE if axis.slides else mujoco.mjtJoint.mjJNT_HINGE
        limits = [axis.lower, axis.upper]
        base.add_joint(name=name, type=kind, axis=axis.direction, range=limits, armature=axis.armature)
        _add_servo(spec, name, axis)
    base.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.03, 0, 0], mass=1.0, contype=0, conaffinity=0)
    forearm = _add_link(base, "forearm", (0, 0, 0), _FOREARM_QUATERNION)
    _add_shapes(forearm, FOREARM)
    return forearm


def _add_servo(spec: Any, joint: str, axis: _Axis) -> None:
    inertia = axis.armature + (_CARRIED_kg if axis.slides else _CARRIED_kg_m2)
    limit = _BASE_FORCE_N if axis.slides else _BASE_TORQUE_Nm
    servo = spec.add_actuator(name=joint, target=joint, trntype=mujoco.mjtTrn.mjTRN_JOINT)
    servo.set_to_position(kp=inertia * _BASE_BANDWIDTH_rad_s**2, kv=2 * inertia * _BASE_BANDWIDTH_rad_s)
    servo.forcerange = [-limit, limit]
    servo.ctrlrange = [axis.lower, axis.upper]


def _add_links(forearm: Any, form: HandForm) -> dict[str, Any]:
    """The hand's links by the name of their joint, parents before children."""
    links = {"forearm": forearm}
    limits_rad = {joint.name: limits for joint, limits in zip(JOINT_TABLE, JOINT_LIMITS_rad, strict=True)}
    for joint in sorted(joint_table(form.side), key=_depth):
        if joint.name[:2] in ("WR", *form.fingers):
            links[joint.name] = _add_hand_link(links[_parent(joint)], joint, limits_rad[joint.name], form)
    return links


def _parent(joint: Joint) -> str:
    return "WRJ1" if joint.parent == "palm" else joint.parent


def _depth(joint: Joint) -> int:
    parents = {other.name: other for other in JOINT_TABLE}
    return 1 + (_depth(parents[_parent(joint)]) if _parent(joint) in parents else 0)


def _add_hand_link(parent: Any, joint: Joint, limits_rad: Any, form: HandForm) -> Any:
    roll, pitch, yaw = joint.rpy_rad
    link = _add_link(parent, joint.name, joint.origin_m, _quaternion(Rot3.Ypr(yaw, pitch, roll)))
    if joint.name in form.joints:
        _add_hinge(link, joint, limits_rad)
    shapes = LINK_SHAPES[joint.name]
    _add_shapes(link, tuple(map(mirror_shape, shapes)) if form.is_left else shapes)
    return link


def _add_hinge(link: Any, joint: Joint, limits_rad: Any) -> None:
    wrist = joint.name.startswith("WR")
    link.add_joint(
        name=joint.name,
        type=mujoco.mjtJoint.mjJNT_HINGE,
        axis=joint.axis,
        range=limits_rad,
        damping=0.5 if wrist else 0.01,
        armature=0.002 if wrist else 0.0004,
        frictionloss=0.0 if wrist else 0.005,
    )


def _add_link(parent: Any, name: str, position_m: Any, quaternion: Any) -> Any:
    """Add a weightless body: the real hand's controller compensates its weight, and only tips load the sensors."""
    link = parent.add_body(name=name, pos=position_m, quat=quaternion)
    link.gravcomp = 1
    return link


def _add_shapes(body: Any, shapes: tuple[Shape, ...]) -> None:
    for shape in shapes:
        body.add_geom(mass=shape.mass_kg, contype=HAND, conaffinity=OBJECT | TABLE, **_geometry(shape))


def _geometry(shape: Shape) -> dict[str, Any]:
    match shape:
        case Capsule():
            ends = [*shape.start_m, *shape.end_m]
            return {"type": mujoco.mjtGeom.mjGEOM_CAPSULE, "fromto": ends, "size": [shape.radius_m, 0, 0]}
        case Ball():
            return {"type": mujoco.mjtGeom.mjGEOM_SPHERE, "pos": shape.centre_m, "size": [shape.radius_m, 0, 0]}
        case Block():
            return {"type": mujoco.mjtGeom.mjGEOM_BOX, "pos": shape.centre_m, "size": shape.half_size_m}
        case Ellipsoid():
            return {"type": mujoco.mjtGeom.mjGEOM_ELLIPSOID, "pos": shape.centre_m, "size": shape.semi_axes_m}


def _add_tip(spec: Any, distal: Any, finger: str, tip: TipBody) -> None:
    """Add the fingertip as a separate body, welded to the distal link through the force sensor."""
    name = f"{finger} tip"
    body = distal.add_body(name=name)
    body.explicitinertial = True
    body.mass = tip.mass_kg
    body.ipos = tip.com_distal_m
    body.inertia = [0.4 * tip.mass_kg * 0.01**2] * 3  # inertia of a 10 mm sphere; no result depends on it
    body.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_ELLIPSOID,
        size=tip.semi_axes_m,
        **_place(tip.distal_T_skin),
        **surface(RUBBER, TIP, OBJECT | TABLE),
    )
    body.add_site(name=name, **_place(tip.distal_T_sensor))
    body.add_site(name=f"{finger} distal")
    for quantity, kind in (("force", mujoco.mjtSensor.mjSENS_FORCE), ("moment", mujoco.mjtSensor.mjSENS_TORQUE)):
        spec.add_sensor(name=f"{finger} {quantity}", type=kind, objtype=mujoco.mjtObj.mjOBJ_SITE, objname=name)


def _add_motors(spec: Any, form: HandForm) -> None:
    for finger in form.long_fingers:
        _add_distal_tendons(spec, finger)
    for joint in form.driven:
        motor = motor_class(joint)
        coupled = joint.endswith("J0")
        kind = mujoco.mjtTrn.mjTRN_TENDON if coupled else mujoco.mjtTrn.mjTRN_JOINT
        actuator = spec.add_actuator(name=joint, target=joint, trntype=kind)
        actuator.gaintype = mujoco.mjtGain.mjGAIN_FIXED
        actuator.biastype = mujoco.mjtBias.mjBIAS_AFFINE
        actuator.gainprm[0] = motor.stall_Nm
        actuator.biasprm[2] = -motor.damping_Nms
        actuator.ctrlrange = [-1, 1]


def _add_distal_tendons(spec: Any, finger: str) -> None:
    """Couple J1 and J2: J0's tendon pulls both equally, an elastic one lets J1 lag behind J2, a stop keeps J1 below
    J2.
    """
    drive = spec.add_tendon(name=f"{finger}J0")
    trail = spec.add_tendon(name=f"{finger} trail")
    trail.stiffness = [_TRAIL_Nm_rad, 0, 0]
    trail.damping = [_TRAIL_Nms_rad, 0, 0]
    trail.springlength = [0, 0]
    stop = spec.add_tendon(name=f"{finger} stop", limited=True, range=[0, np.pi / 2])
    for tendon, share_of_j1 in ((drive, 1.0), (trail, 1.0), (stop, -1.0)):
        tendon.wrap_joint(f"{finger}J1", share_of_j1)
    for tendon, share_of_j2 in ((drive, 1.0), (trail, -DISTAL_COUPLING), (stop, 1.0)):
        tendon.wrap_joint(f"{finger}J2", share_of_j2)


def _add_object(spec: Any, target: ObjectModel, mass_kg: float) -> None:
    body = spec.worldbody.add_body(name="object", pos=[0, 0, target.rest_height_m])
    body.add_freejoint(name="object")
    _set_inertia(body, target, mass_kg)
    touched = surface(WOOD, OBJECT | FOOT if target.hull is None else OBJECT, HAND | TIP)
    for index, piece in enumerate(target.pieces):
        body.add_geom(name=f"object {index}", **_piece_geometry(spec, piece, f"object piece {index}"), **touched)
    if target.hull is not None:
        body.add_geom(name="object foot", **_piece_geometry(spec, target.hull, "foot"), **surface(WOOD, FOOT, 0))


def _set_inertia(body: Any, target: ObjectModel, mass_kg: float) -> None:
    """Set mass and inertia from the truth mesh with uniform density, because the pieces may overlap."""
    inertia = np.array(target.mesh.moment_inertia) * mass_kg / target.mesh.volume
    body.explicitinertial = True
    body.mass = mass_kg
    body.ipos = (0, 0, 0)
    body.fullinertia = [inertia[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]


def _piece_geometry(spec: Any, piece: Piece, mesh_name: str) -> dict[str, Any]:
    if isinstance(piece, Hull):
        spec.add_mesh(name=mesh_name, uservert=piece.vertices_object_m.ravel())
        return {"type": mujoco.mjtGeom.mjGEOM_MESH, "meshname": mesh_name}
    kinds = {
        "box": mujoco.mjtGeom.mjGEOM_BOX,
        "cylinder": mujoco.mjtGeom.mjGEOM_CYLINDER,
        "sphere": mujoco.mjtGeom.mjGEOM_SPHERE,
    }
    size = [*piece.size_m, 0.0, 0.0][:3]
    return {"type": kinds[piece.kind], "size": size, "pos": piece.position_object_m}


def _place(pose: Pose3) -> dict[str, Any]:
    return {"pos": pose.translation(), "quat": _quaternion(pose.rotation())}


def _quaternion(rotation: Rot3) -> Array:
    quaternion = np.zeros(4)
    mujoco.mju_mat2Quat(quaternion, rotation.matrix().ravel())
    return quaternion
