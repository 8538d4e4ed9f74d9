"""What viewers show as messages of Foxglove's protobuf types, made by its own package.

Two of ROS's types go with them, for which Foxglove has none: wrenches, and the robot's description.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import lru_cache
from typing import Any

import foxglove.messages as fm
import numpy as np
from gtsam import Pose3, Rot3

from drivers.core.clock import NANOSECONDS
from drivers.core.contacts import Array
from tactile_lab.viewers import cdr
from tactile_lab.viewers.encoded import Encoded, Schema, Topic
from tactile_lab.viewers.items import (
    Candidates,
    Frames,
    Item,
    Joints,
    Lens,
    Loads,
    ObjectPose,
    Picture,
    Remark,
    SensorWrench,
    Surface,
    Touches,
)
from tactile_lab.viewers.parts import BoxPart, CapsulePart, EllipsoidPart, Part, rotation_onto
from tactile_lab.viewers.robot import CAMERA, OBJECT, TABLE, TRUE_OBJECT, WORLD, Placement, Robot, table_part
from tactile_lab.viewers.urdf import urdf

FORCE_SCALE_m_N = 0.025
"""Length of a force's arrow."""
TOUCHING_N = 0.1
_HAND, _TIP, _PLATE = (0.47, 0.50, 0.54, 1.0), (0.36, 0.44, 0.56, 1.0), (0.86, 0.88, 0.90, 1.0)
_NORMAL, _FORCE, _ELLIPSOID = (0.9, 0.3, 0.1, 1.0), (0.78, 0.16, 0.16, 1.0), (0.9, 0.3, 0.1, 0.35)
_CANDIDATE, _CHOSEN, _LOADED = (0.45, 0.45, 0.50, 0.5), (0.84, 0.35, 0.63, 1.0), (0.18, 0.63, 0.26, 1.0)
_NORMAL_m, _CANDIDATE_m, _SIGMAS = 0.02, 0.03, 2.0
_FLOAT32, _UINT8 = fm.PackedElementFieldNumericType.Float32, fm.PackedElementFieldNumericType.Uint8

Colour = tuple[float, float, float, float]


class FoxgloveMessages:
    """Makes the messages of items.

    Args:
        robot: of the session.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot = robot

    def begin(self, stamp_ns: int) -> Iterator[Encoded]:
        """What never changes: the robot's description, and its links as solids fixed to their frames."""
        yield Encoded(DESCRIPTION, stamp_ns, cdr.string(urdf(self._robot)), "urdf")
        parts = {TABLE: (table_part(self._robot),), **self._robot.parts}
        entities = [_link(stamp_ns, link, solids) for link, solids in parts.items()]
        yield Encoded(_topic("/robot/scene", fm.SceneUpdate), stamp_ns, fm.SceneUpdate(entities=entities).encode(), "")

    def of(self, item: Item) -> Iterator[Encoded]:
        """The messages of one item."""
        if isinstance(item, SensorWrench):
            data = cdr.wrench_stamped(item.stamp_ns, item.frame, item.force_N, item.torque_Nm)
            yield Encoded(_wrench_topic(item.finger), item.stamp_ns, data)
            return
        for name, message, key in _MAKERS[type(item)](item):
            kind: Any = type(message)
            yield Encoded(_topic(name, kind), item.stamp_ns, message.encode(), key)


DESCRIPTION = Topic("/robot_description", "cdr", Schema("std_msgs/msg/String", "ros2msg", cdr.STRING.encode()))


@lru_cache(maxsize=64)
def _topic(name: str, kind: Any) -> Topic:
    schema = kind.get_schema()
    return Topic(name, "protobuf", Schema(schema.name, schema.encoding, schema.data))


@lru_cache(maxsize=16)
def _wrench_topic(finger: str) -> Topic:
    schema = Schema("geometry_msgs/msg/WrenchStamped", "ros2msg", cdr.WRENCH_STAMPED.encode())
    return Topic(f"/ft/{finger}/wrench", "cdr", schema)


# --- one kind of item each: topic, message, and the key under which it lasts ----------------------------------------

Made = Iterator[tuple[str, Any, str | None]]


def _frames(item: Frames) -> Made:
    transforms = [_transform(item.stamp_ns, placement) for placement in item.placements]
    names = ",".join(placement.child for placement in item.placements)
    yield ("/tf_static" if item.lasting else "/tf"), fm.FrameTransforms(transforms=transforms), names


def _joints(item: Joints) -> Made:
    joints = [fm.JointState(name=name, position=position) for name, position in item.positions.items()]
    yield "/joint_states", fm.JointStates(timestamp=_time(item.stamp_ns), joints=joints), None


def _loads(item: Loads) -> Made:
    entities = []
    for finger, load_N in item.load_N.items():
        known = load_N is not None and np.isfinite(load_N)
        text = f"{finger} {load_N:.2f} N" if known else f"{finger} ?"
        colour = _LOADED if known and load_N is not None and load_N > TOUCHING_N else _TIP
        label = fm.TextPrimitive(
            pose=_pose(Pose3(Rot3(), np.array([0.0, 0.0, 0.04]))),
            billboard=True,
            font_size=0.006,
            color=_colour(colour),
            text=text,
        )
        entities.append(_entity(item.stamp_ns, item.frames[finger], f"load-{finger}", texts=[label], locked=True))
    yield "/loads", fm.SceneUpdate(entities=entities), None


def _touches(item: Touches) -> Made:
    arrows = [_arrow(one.point_world_m, one.normal_world, _NORMAL_m, _NORMAL) for one in item.touches]
    forces = [
        _arrow(one.point_world_m + FORCE_SCALE_m_N * one.force_N * one.normal_world, -one.normal_world,
               FORCE_SCALE_m_N * one.force_N, _FORCE)
        for one in item.touches
        if one.force_N > 0.0
    ]  # fmt: skip
    spheres = [_uncertainty(one.point_world_m, one.covariance_m2) for one in item.touches]
    facts = {"grasp": str(item.grasp), "fingers": " ".join(one.finger for one in item.touches)}
    gone = [_deletion(item.stamp_ns, f"grasp-{number}") for number in item.gone]
    newest = _entity(item.stamp_ns, WORLD, "forces", arrows=forces)
    entity = _entity(item.stamp_ns, WORLD, f"grasp-{item.grasp}", arrows=arrows, spheres=spheres, facts=facts)
    yield "/contacts/scene", fm.SceneUpdate(deletions=gone, entities=[entity]), f"grasp-{item.grasp}"
    yield "/contacts/forces", fm.SceneUpdate(entities=[newest]), ""
    columns = dict(zip("xyz", item.points_world_m.T, strict=True))
    columns |= dict(zip(("normal_x", "normal_y", "normal_z"), item.normals_world.T, strict=True))
    yield "/contacts/points", _cloud(item.stamp_ns, WORLD, {**columns, "force_N": item.forces_N}), ""


def _surface(item: Surface) -> Made:
    facts = {
        "explored": f"{item.explored:.3f}",
        "sigma_median_mm": f"{1e3 * float(np.median(item.sigma_m)):.2f}" if len(item.sigma_m) else "",
    }
    if not len(item.vertices_m):
        yield "/object/surface", fm.SceneUpdate(deletions=[_deletion(item.stamp_ns, "surface")]), ""
        return
    mesh = fm.TriangleListPrimitive(
        points=[fm.Point3(x=x, y=y, z=z) for x, y, z in item.vertices_m.tolist()],
        colors=[fm.Color(r=r, g=g, b=b, a=0.85) for r, g, b in (item.colours / 255.0).tolist()],
        indices=item.triangles.ravel().tolist(),
    )
    entity = _entity(item.stamp_ns, OBJECT, "surface", triangles=[mesh], facts=facts, locked=True)
    yield "/object/surface", fm.SceneUpdate(entities=[entity]), ""
    columns = {**dict(zip("xyz", item.vertices_m.T, strict=True)), "sigma_m": item.sigma_m}
    yield "/object/points", _cloud(item.stamp_ns, OBJECT, columns, item.colours), ""


def _object(item: ObjectPose) -> Made:
    name = "/truth/object" if item.true else "/object/pose"
    yield name, fm.PoseInFrame(timestamp=_time(item.stamp_ns), frame_id=WORLD, pose=_pose(item.world_T_object)), ""
    if not item.true:
        covariance = None if item.covariance is None else item.covariance.ravel().tolist()
        yield (
            "/object/odometry",
            fm.Odometry(
                timestamp=_time(item.stamp_ns),
                frame_id=WORLD,
                body_frame_id=TRUE_OBJECT if item.true else OBJECT,
                pose=_pose(item.world_T_object),
                pose_covariance=covariance,
            ),
            "",
        )


def _candidates(item: Candidates) -> Made:
    arrows, texts = [], []
    for one in item.candidates:
        place, ahead = np.array(one.world_T_grasp.translation()), one.world_T_grasp.rotation().matrix()[:, 0]
        arrows.append(_arrow(place, ahead, _CANDIDATE_m, _CHOSEN if one.chosen else _CANDIDATE))
        if one.chosen:
            above = Pose3(Rot3(), place + np.array([0.0, 0.0, 0.05]))
            label = fm.TextPrimitive(
                pose=_pose(above), billboard=True, font_size=0.008, color=_colour(_CHOSEN), text=item.text
            )
            texts.append(label)
    scores = [one.score for one in item.candidates]
    facts = {"text": item.text, "scores": " ".join("?" if score is None else f"{score:.4g}" for score in scores)}
    entity = _entity(item.stamp_ns, WORLD, "candidates", arrows=arrows, texts=texts, facts=facts)
    yield "/candidates", fm.SceneUpdate(entities=[entity]), ""


def _picture(item: Picture) -> Made:
    image = fm.CompressedImage(timestamp=_time(item.stamp_ns), frame_id=CAMERA, data=item.encoded, format=item.kind)
    yield "/camera/image", image, ""


def _lens(item: Lens) -> Made:
    projection = np.hstack([item.matrix, np.zeros((3, 1))])
    yield (
        "/camera/calibration",
        fm.CameraCalibration(
            timestamp=_time(item.stamp_ns),
            frame_id=CAMERA,
            width=item.size_px[0],
            height=item.size_px[1],
            distortion_model=item.model,
            D=list(item.distortion),
            K=item.matrix.ravel().tolist(),
            R=np.eye(3).ravel().tolist(),
            P=projection.ravel().tolist(),
        ),
        "",
    )


def _remark(item: Remark) -> Made:
    level = {2: fm.LogLevel.Info, 3: fm.LogLevel.Warning, 4: fm.LogLevel.Error}.get(item.level, fm.LogLevel.Unknown)
    yield "/log", fm.Log(timestamp=_time(item.stamp_ns), level=level, message=item.text, name=item.source), None


_MAKERS: Mapping[type, Callable[[Any], Made]] = {
    Frames: _frames,
    Joints: _joints,
    Loads: _loads,
    Touches: _touches,
    Surface: _surface,
    ObjectPose: _object,
    Candidates: _candidates,
    Picture: _picture,
    Lens: _lens,
    Remark: _remark,
}


# --- pieces --------------------------------------------------------------------------------------------------------


def _link(stamp_ns: int, link: str, solids: Sequence[Part]) -> Any:
    colour = _PLATE if link == TABLE else _TIP if link.endswith("distal") else _HAND
    cubes, spheres, cylinders = [], [], []
    for part in solids:
        if isinstance(part, BoxPart):
            cubes.append(
                fm.CubePrimitive(pose=_pose(part.link_T_part), size=_vector(part.size_m), color=_colour(colour))
            )
        elif isinstance(part, EllipsoidPart):
            spheres.append(_sphere(part.link_T_part, 2 * np.array(part.semi_axes_m), colour))
        else:
            cylinders.append(_cylinder(part, colour))
            spheres += [_sphere(end, np.full(3, 2 * part.radius_m), colour) for end in _ends(part)]
    return _entity(stamp_ns, link, link, cubes=cubes, spheres=spheres, cylinders=cylinders, locked=True)


def _ends(part: CapsulePart) -> list[Pose3]:
    half = np.array([0.0, 0.0, part.length_m / 2])
    return [part.link_T_part * Pose3(Rot3(), sign * half) for sign in (-1.0, 1.0)]


def _cylinder(part: CapsulePart, colour: Colour) -> Any:
    size = _vector((2 * part.radius_m, 2 * part.radius_m, part.length_m))
    pose = _pose(part.link_T_part)
    return fm.CylinderPrimitive(pose=pose, size=size, bottom_scale=1.0, top_scale=1.0, color=_colour(colour))


def _sphere(pose: Pose3, size_m: Array, colour: Colour) -> Any:
    return fm.SpherePrimitive(pose=_pose(pose), size=_vector(size_m), color=_colour(colour))


def _uncertainty(point_m: Array, covariance_m2: Array) -> Any:
    """An ellipsoid of two standard deviations about a point."""
    variances, axes = np.linalg.eigh(covariance_m2)
    if np.linalg.det(axes) < 0.0:
        axes[:, 0] *= -1.0
    size_m = 2 * _SIGMAS * np.sqrt(np.maximum(variances, 0.0))
    return _sphere(Pose3(Rot3(axes), point_m), size_m, _ELLIPSOID)


def _arrow(start_m: Array, direction: Array, length_m: float, colour: Colour) -> Any:
    """An arrow along a unit vector; Foxglove's point along x."""
    pose = _pose(Pose3(Rot3(rotation_onto(np.asarray(direction), axis=0)), np.asarray(start_m)))
    return fm.ArrowPrimitive(
        pose=pose,
        shaft_length=0.75 * length_m,
        shaft_diameter=0.0015,
        head_length=0.25 * length_m,
        head_diameter=0.004,
        color=_colour(colour),
    )


def _entity(
    stamp_ns: int, frame: str, name: str, *, locked: bool = False, facts: Mapping[str, str] | None = None, **solids: Any
) -> Any:
    """An entity that stays until one of the same name replaces it."""
    pairs = [fm.KeyValuePair(key=key, value=value) for key, value in (facts or {}).items()]
    return fm.SceneEntity(
        timestamp=_time(stamp_ns),
        frame_id=frame,
        id=name,
        lifetime=fm.Duration(0, 0),
        frame_locked=locked,
        metadata=pairs,
        **solids,
    )


def _deletion(stamp_ns: int, name: str) -> Any:
    return fm.SceneEntityDeletion(timestamp=_time(stamp_ns), type=fm.SceneEntityDeletionType.MatchingId, id=name)


def _cloud(stamp_ns: int, frame: str, columns: Mapping[str, Array], colours: Any = None) -> Any:
    """Points with columns as 32-bit numbers, x, y and z among them; with red, green, blue and alpha if coloured."""
    dtype = [(name, "<f4") for name in columns]
    fields = [fm.PackedElementField(name=name, offset=4 * i, type=_FLOAT32) for i, name in enumerate(columns)]
    if colours is not None:
        names, begin = ("red", "green", "blue", "alpha"), 4 * len(columns)
        dtype += [(name, "u1") for name in names]
        fields += [fm.PackedElementField(name=name, offset=begin + i, type=_UINT8) for i, name in enumerate(names)]
    table = np.zeros(len(next(iter(columns.values()))), dtype=dtype)
    for name, column in columns.items():
        table[name] = column
    if colours is not None:
        for name, channel in zip(("red", "green", "blue"), colours.T, strict=True):
            table[name] = channel
        table["alpha"] = 255
    return fm.PointCloud(
        timestamp=_time(stamp_ns),
        frame_id=frame,
        pose=_pose(Pose3()),
        point_stride=table.dtype.itemsize,
        fields=fields,
        data=table.tobytes(),
    )


def _transform(stamp_ns: int, placement: Placement) -> Any:
    return fm.FrameTransform(
        timestamp=_time(stamp_ns),
        parent_frame_id=placement.parent,
        child_frame_id=placement.child,
        translation=_vector(placement.parent_T_child.translation()),
        rotation=_quaternion(placement.parent_T_child),
    )


def _time(stamp_ns: int) -> Any:
    return fm.Timestamp(stamp_ns // NANOSECONDS, stamp_ns % NANOSECONDS)


def _pose(pose: Pose3) -> Any:
    return fm.Pose(position=_vector(pose.translation()), orientation=_quaternion(pose))


def _vector(values: Any) -> Any:
    x, y, z = (float(value) for value in values)
    return fm.Vector3(x=x, y=y, z=z)


def _quaternion(pose: Pose3) -> Any:
    turn: Any = pose.rotation().toQuaternion()
    return fm.Quaternion(x=turn.x(), y=turn.y(), z=turn.z(), w=turn.w())


def _colour(colour: Colour) -> Any:
    red, green, blue, alpha = colour
    return fm.Color(r=red, g=green, b=blue, a=alpha)
