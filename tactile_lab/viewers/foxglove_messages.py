"""What viewers show as messages of Foxglove's protobuf types, made by its own package.

Two of ROS's types go with them, for which Foxglove has none: wrenches, and the robot's description.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import lru_cache
from typing import Any

import foxglove.messages as fm
import numpy as np
from gtsam import Pose3, Rot3

from tactile_lab.viewers import cdr
from tactile_lab.viewers.encoded import Encoded, Schema, Topic
from tactile_lab.viewers.foxglove_pieces import (
    TIP_COLOUR,
    arrow,
    colour_message,
    deletion,
    frame_transform,
    lasting_entity,
    link_entity,
    point_cloud,
    pose_message,
    timestamp,
    uncertainty_ellipsoid,
)
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
from tactile_lab.viewers.robot import CAMERA, OBJECT, TABLE, WORLD, Robot, table_part
from tactile_lab.viewers.urdf import urdf

FORCE_SCALE_m_N = 0.025
"""Length of a force's arrow."""
TOUCHING_N = 0.1
_NORMAL, _FORCE = (0.9, 0.3, 0.1, 1.0), (0.78, 0.16, 0.16, 1.0)
_CANDIDATE, _CHOSEN, _LOADED = (0.45, 0.45, 0.50, 0.5), (0.84, 0.35, 0.63, 1.0), (0.18, 0.63, 0.26, 1.0)
_NORMAL_m, _CANDIDATE_m = 0.02, 0.03


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
        entities = [link_entity(stamp_ns, link, solids) for link, solids in parts.items()]
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
    transforms = [frame_transform(item.stamp_ns, placement) for placement in item.placements]
    if item.lasting:
        yield "/tf_static", fm.FrameTransforms(transforms=transforms), ""
    else:
        names = ",".join(placement.child for placement in item.placements)
        yield "/tf", fm.FrameTransforms(transforms=transforms), names


def _joints(item: Joints) -> Made:
    joints = [fm.JointState(name=name, position=position) for name, position in item.positions.items()]
    yield "/joint_states", fm.JointStates(timestamp=timestamp(item.stamp_ns), joints=joints), None


def _loads(item: Loads) -> Made:
    entities = []
    for finger, load_N in item.load_N.items():
        known = load_N is not None and np.isfinite(load_N)
        text = f"{finger} {load_N:.2f} N" if known else f"{finger} ?"
        colour = _LOADED if known and load_N is not None and load_N > TOUCHING_N else TIP_COLOUR
        label = fm.TextPrimitive(
            pose=pose_message(Pose3(Rot3(), np.array([0.0, 0.0, 0.04]))),
            billboard=True,
            font_size=0.006,
            color=colour_message(colour),
            text=text,
        )
        entities.append(
            lasting_entity(item.stamp_ns, item.frames[finger], f"load-{finger}", texts=[label], locked=True)
        )
    yield "/loads", fm.SceneUpdate(entities=entities), None


def _touches(item: Touches) -> Made:
    arrows = [arrow(one.point_world_m, one.normal_world, _NORMAL_m, _NORMAL) for one in item.touches]
    forces = [
        arrow(one.point_world_m + FORCE_SCALE_m_N * one.force_N * one.normal_world, -one.normal_world,
               FORCE_SCALE_m_N * one.force_N, _FORCE)
        for one in item.touches
        if one.force_N > 0.0
    ]  # fmt: skip
    spheres = [uncertainty_ellipsoid(one.point_world_m, one.covariance_m2) for one in item.touches]
    facts = {"grasp": str(item.grasp), "fingers": " ".join(one.finger for one in item.touches)}
    gone = [deletion(item.stamp_ns, f"grasp-{number}") for number in item.gone]
    newest = lasting_entity(item.stamp_ns, WORLD, "forces", arrows=forces)
    entity = lasting_entity(item.stamp_ns, WORLD, f"grasp-{item.grasp}", arrows=arrows, spheres=spheres, facts=facts)
    yield "/contacts/scene", fm.SceneUpdate(deletions=gone, entities=[entity]), f"grasp-{item.grasp}"
    yield "/contacts/forces", fm.SceneUpdate(entities=[newest]), ""
    columns = dict(zip("xyz", item.points_world_m.T, strict=True))
    columns |= dict(zip(("normal_x", "normal_y", "normal_z"), item.normals_world.T, strict=True))
    yield "/contacts/points", point_cloud(item.stamp_ns, WORLD, {**columns, "force_N": item.forces_N}), ""


def _surface(item: Surface) -> Made:
    facts = {
        "explored": f"{item.explored:.3f}",
        "sigma_median_mm": f"{1e3 * float(np.median(item.sigma_m)):.2f}" if len(item.sigma_m) else "",
    }
    if not len(item.vertices_m):
        yield "/object/surface", fm.SceneUpdate(deletions=[deletion(item.stamp_ns, "surface")]), ""
        return
    mesh = fm.TriangleListPrimitive(  # opaque: viewers do not sort triangles, and the far side would show in patches
        points=[fm.Point3(x=x, y=y, z=z) for x, y, z in item.vertices_m.tolist()],
        colors=[fm.Color(r=r, g=g, b=b, a=1.0) for r, g, b in (item.colours / 255.0).tolist()],
        indices=item.triangles.ravel().tolist(),
    )
    entity = lasting_entity(item.stamp_ns, OBJECT, "surface", triangles=[mesh], facts=facts, locked=True)
    yield "/object/surface", fm.SceneUpdate(entities=[entity]), ""
    columns = {**dict(zip("xyz", item.vertices_m.T, strict=True)), "sigma_m": item.sigma_m}
    yield "/object/points", point_cloud(item.stamp_ns, OBJECT, columns, item.colours), ""


def _object(item: ObjectPose) -> Made:
    name = "/truth/object" if item.true else "/object/pose"
    yield (
        name,
        fm.PoseInFrame(timestamp=timestamp(item.stamp_ns), frame_id=WORLD, pose=pose_message(item.world_T_object)),
        "",
    )
    if not item.true:
        covariance = None if item.covariance is None else item.covariance.ravel().tolist()
        yield (
            "/object/odometry",
            fm.Odometry(
                timestamp=timestamp(item.stamp_ns),
                frame_id=WORLD,
                body_frame_id=OBJECT,
                pose=pose_message(item.world_T_object),
                pose_covariance=covariance,
            ),
            "",
        )


def _candidates(item: Candidates) -> Made:
    arrows, texts = [], []
    for one in item.candidates:
        place, ahead = np.array(one.world_T_grasp.translation()), one.world_T_grasp.rotation().matrix()[:, 0]
        arrows.append(arrow(place, ahead, _CANDIDATE_m, _CHOSEN if one.chosen else _CANDIDATE))
        if one.chosen:
            above = Pose3(Rot3(), place + np.array([0.0, 0.0, 0.05]))
            label = fm.TextPrimitive(
                pose=pose_message(above), billboard=True, font_size=0.008, color=colour_message(_CHOSEN), text="next"
            )
            texts.append(label)
    scores = [one.score for one in item.candidates]
    facts = {"text": item.text, "scores": " ".join("?" if score is None else f"{score:.4g}" for score in scores)}
    entity = lasting_entity(item.stamp_ns, WORLD, "candidates", arrows=arrows, texts=texts, facts=facts)
    yield "/candidates", fm.SceneUpdate(entities=[entity]), ""


def _picture(item: Picture) -> Made:
    image = fm.CompressedImage(timestamp=timestamp(item.stamp_ns), frame_id=CAMERA, data=item.encoded, format=item.kind)
    yield "/camera/image", image, ""


def _lens(item: Lens) -> Made:
    projection = np.hstack([item.matrix, np.zeros((3, 1))])
    yield (
        "/camera/calibration",
        fm.CameraCalibration(
            timestamp=timestamp(item.stamp_ns),
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
    yield "/log", fm.Log(timestamp=timestamp(item.stamp_ns), level=level, message=item.text, name=item.source), None


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
