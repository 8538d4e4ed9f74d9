"""What viewers show, as ROS 2's message types; made without ROS by the package ``rosbags``."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from gtsam import Pose3, Rot3

from drivers.core.clock import NANOSECONDS
from drivers.core.contacts import Array
from tactile_lab.viewers.items import (
    Candidates,
    Frames,
    Item,
    Joints,
    Lens,
    ObjectPose,
    Picture,
    SensorWrench,
    Surface,
    Touches,
)
from tactile_lab.viewers.parts import rotation_onto
from tactile_lab.viewers.robot import CAMERA, OBJECT, WORLD, Robot
from tactile_lab.viewers.urdf import urdf

Made = Iterator[tuple[str, str, int, Any]]
"""Topic, type, stamp and message."""

JOINT_STATE, WRENCH = "sensor_msgs/msg/JointState", "geometry_msgs/msg/WrenchStamped"
TRANSFORMS, TEXT = "tf2_msgs/msg/TFMessage", "std_msgs/msg/String"
POSE, POSE_WITH_COVARIANCE = "geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/PoseWithCovarianceStamped"
PICTURE, CAMERA_INFO = "sensor_msgs/msg/CompressedImage", "sensor_msgs/msg/CameraInfo"
CLOUD, MARKER, MARKERS = (
    "sensor_msgs/msg/PointCloud2",
    "visualization_msgs/msg/Marker",
    "visualization_msgs/msg/MarkerArray",
)

_ARROW, _TRIANGLES = 0, 11
"""``Marker.type``."""
_ADD, _DELETE = 0, 2
"""``Marker.action``."""
_FLOAT32 = 7
"""``PointField.datatype``."""
_CONTACT, _CANDIDATE, _CHOSEN = (0.9, 0.3, 0.1, 1.0), (0.45, 0.45, 0.5, 0.5), (0.84, 0.35, 0.63, 1.0)
_NORMAL_m, _CANDIDATE_m = 0.02, 0.03
_MOST_FINGERS = 10
"""Ids of a grasp's markers are this far apart."""


class RosMessages:
    """Makes messages of ROS.

    Args:
        types: the classes of a typestore, by name.
        robot: of the session.
    """

    def __init__(self, types: Mapping[str, Any], robot: Robot) -> None:
        self._types, self._robot = types, robot
        self._makers: Mapping[type, Callable[[Any], Made]] = {
            Frames: self._frames,
            Touches: self._touches,
            Surface: self._surface,
            ObjectPose: self._object,
            Candidates: self._candidates,
            Picture: self._picture,
            Lens: self._lens,
        }

    def description(self, stamp_ns: int) -> Made:
        """The robot's description."""
        yield "/robot_description", TEXT, stamp_ns, self._types[TEXT](urdf(self._robot))

    def of(self, item: Item) -> Made:
        """The messages of an item; none for one that the tables hold at full rate."""
        if (make := self._makers.get(type(item))) is not None:
            yield from make(item)

    def live(self, item: Item) -> Made:
        """The messages of an item of a running session, which has no tables."""
        if isinstance(item, Joints):
            state = self.joint_state(item.stamp_ns, list(item.positions), list(item.positions.values()))
            yield "/joint_states", JOINT_STATE, item.stamp_ns, state
        elif isinstance(item, SensorWrench):
            wrench = self.wrench(item.stamp_ns, item.finger, [*item.force_N, *item.torque_Nm])
            yield f"/ft/{item.finger}/wrench", WRENCH, item.stamp_ns, wrench
        else:
            yield from self.of(item)

    # --- rows of tables ----------------------------------------------------------------------------------------

    def joint_state(self, stamp_ns: int, names: Sequence[str], positions: Sequence[float]) -> Any:
        """Joints by the robot's names."""
        none = np.zeros(0)
        return self._types[JOINT_STATE](
            self._header(stamp_ns, ""), list(names), np.array(positions, dtype=np.float64), none, none
        )

    def wrench(self, stamp_ns: int, finger: str, row: Sequence[Any]) -> Any:
        """A sensor's raw wrench: six numbers, N and N m."""
        wrench = self._types["geometry_msgs/msg/Wrench"](self._vector(row[:3]), self._vector(row[3:6]))
        return self._types[WRENCH](self._header(stamp_ns, self._robot.sensor_frame(finger)), wrench)

    def text(self, columns: Sequence[str], row: Sequence[Any]) -> Any:
        """Anything without a type of ROS, as JSON."""
        plain = [value.item() if isinstance(value, np.generic) else value for value in row]
        return self._types[TEXT](json.dumps(dict(zip(columns, plain, strict=True))))

    # --- items -------------------------------------------------------------------------------------------------

    def _frames(self, item: Frames) -> Made:
        transforms = [
            self._types["geometry_msgs/msg/TransformStamped"](
                self._header(item.stamp_ns, one.parent),
                one.child,
                self._types["geometry_msgs/msg/Transform"](
                    self._vector(one.parent_T_child.translation()), self._quaternion(one.parent_T_child)
                ),
            )
            for one in item.placements
        ]
        yield ("/tf_static" if item.lasting else "/tf"), TRANSFORMS, item.stamp_ns, self._types[TRANSFORMS](transforms)

    def _touches(self, item: Touches) -> Made:
        gone = [
            self._marker(item.stamp_ns, WORLD, "contacts", number * _MOST_FINGERS + finger, _ARROW, action=_DELETE)
            for number in item.gone
            for finger in range(_MOST_FINGERS)
        ]
        arrows = [
            self._arrow(item.stamp_ns, "contacts", item.grasp * _MOST_FINGERS + number, one.point_world_m,
                        one.normal_world, _NORMAL_m, _CONTACT)
            for number, one in enumerate(item.touches)
        ]  # fmt: skip
        yield "/contacts/markers", MARKERS, item.stamp_ns, self._types[MARKERS]([*gone, *arrows])
        columns = dict(zip("xyz", item.points_world_m.T, strict=True))
        columns |= dict(zip(("normal_x", "normal_y", "normal_z"), item.normals_world.T, strict=True))
        cloud = self._cloud(item.stamp_ns, WORLD, {**columns, "force_N": item.forces_N})
        yield "/contacts/points", CLOUD, item.stamp_ns, cloud

    def _surface(self, item: Surface) -> Made:
        corners = item.triangles.ravel()
        rows = item.colours / 255.0
        action = _ADD if len(corners) else _DELETE
        marker = self._marker(item.stamp_ns, OBJECT, "surface", 0, _TRIANGLES, action=action)
        marker.points = [self._types["geometry_msgs/msg/Point"](*place) for place in item.vertices_m[corners].tolist()]
        marker.colors = [self._types["std_msgs/msg/ColorRGBA"](*rgb, 1.0) for rgb in rows[corners].tolist()]
        marker.frame_locked = True
        yield "/object/surface", MARKER, item.stamp_ns, marker
        columns = {**dict(zip("xyz", item.vertices_m.T, strict=True)), "sigma_m": item.sigma_m}
        yield "/object/points", CLOUD, item.stamp_ns, self._cloud(item.stamp_ns, OBJECT, columns)

    def _object(self, item: ObjectPose) -> Made:
        pose, header = self._pose(item.world_T_object), self._header(item.stamp_ns, WORLD)
        if item.true:
            yield "/truth/object", POSE, item.stamp_ns, self._types[POSE](header, pose)
            return
        covariance = np.zeros(36) if item.covariance is None else item.covariance.ravel()
        told = self._types["geometry_msgs/msg/PoseWithCovariance"](pose, covariance)
        yield "/object/pose", POSE_WITH_COVARIANCE, item.stamp_ns, self._types[POSE_WITH_COVARIANCE](header, told)

    def _candidates(self, item: Candidates) -> Made:
        clear = self._marker(item.stamp_ns, WORLD, "candidates", 0, _ARROW, action=3)  # all of this topic
        arrows = []
        for number, one in enumerate(item.candidates):
            place, ahead = np.array(one.world_T_grasp.translation()), one.world_T_grasp.rotation().matrix()[:, 0]
            colour = _CHOSEN if one.chosen else _CANDIDATE
            arrows.append(self._arrow(item.stamp_ns, "candidates", number, place, ahead, _CANDIDATE_m, colour))
        yield "/candidates", MARKERS, item.stamp_ns, self._types[MARKERS]([clear, *arrows])

    def _picture(self, item: Picture) -> Made:
        header = self._header(item.stamp_ns, CAMERA)
        image = self._types[PICTURE](header, item.kind, np.frombuffer(item.encoded, np.uint8))
        yield "/camera/image/compressed", PICTURE, item.stamp_ns, image

    def _lens(self, item: Lens) -> Made:
        region = self._types["sensor_msgs/msg/RegionOfInterest"](0, 0, 0, 0, False)
        projection = np.hstack([item.matrix, np.zeros((3, 1))])
        info = self._types[CAMERA_INFO](
            header=self._header(item.stamp_ns, CAMERA),
            height=item.size_px[1],
            width=item.size_px[0],
            distortion_model=item.model,
            d=np.array(item.distortion, dtype=np.float64),
            k=item.matrix.ravel(),
            r=np.eye(3).ravel(),
            p=projection.ravel(),
            binning_x=0,
            binning_y=0,
            roi=region,
        )
        yield "/camera/camera_info", CAMERA_INFO, item.stamp_ns, info

    # --- pieces ------------------------------------------------------------------------------------------------

    def _header(self, stamp_ns: int, frame: str) -> Any:
        stamp = self._types["builtin_interfaces/msg/Time"](stamp_ns // NANOSECONDS, stamp_ns % NANOSECONDS)
        return self._types["std_msgs/msg/Header"](stamp, frame)

    def _vector(self, values: Any) -> Any:
        return self._types["geometry_msgs/msg/Vector3"](*(float(value) for value in values))

    def _quaternion(self, pose: Pose3) -> Any:
        turn: Any = pose.rotation().toQuaternion()
        return self._types["geometry_msgs/msg/Quaternion"](turn.x(), turn.y(), turn.z(), turn.w())

    def _pose(self, pose: Pose3) -> Any:
        place = self._types["geometry_msgs/msg/Point"](*(float(value) for value in pose.translation()))
        return self._types["geometry_msgs/msg/Pose"](place, self._quaternion(pose))

    def _arrow(
        self, stamp_ns: int, group: str, number: int, start_m: Array, direction: Array, length_m: float,
        colour: tuple[float, float, float, float],
    ) -> Any:  # fmt: skip
        """An arrow along a unit vector; ROS's point along x."""
        marker = self._marker(stamp_ns, WORLD, group, number, _ARROW)
        marker.pose = self._pose(Pose3(Rot3(rotation_onto(np.asarray(direction), axis=0)), np.asarray(start_m)))
        marker.scale = self._vector((length_m, 0.002, 0.004))
        marker.color = self._types["std_msgs/msg/ColorRGBA"](*colour)
        return marker

    def _marker(self, stamp_ns: int, frame: str, group: str, number: int, kind: int, *, action: int = _ADD) -> Any:
        """A marker at its frame's origin, to be filled in."""
        nothing = self._types["sensor_msgs/msg/CompressedImage"](self._header(0, ""), "", np.zeros(0, np.uint8))
        return self._types[MARKER](
            header=self._header(stamp_ns, frame),
            ns=group,
            id=number,
            type=kind,
            action=action,
            pose=self._pose(Pose3()),
            scale=self._vector((1.0, 1.0, 1.0)),
            color=self._types["std_msgs/msg/ColorRGBA"](1.0, 1.0, 1.0, 1.0),
            lifetime=self._types["builtin_interfaces/msg/Duration"](0, 0),
            frame_locked=False,
            points=[],
            colors=[],
            texture_resource="",
            texture=nothing,
            uv_coordinates=[],
            text="",
            mesh_resource="",
            mesh_file=self._types["visualization_msgs/msg/MeshFile"]("", np.zeros(0, np.uint8)),
            mesh_use_embedded_materials=False,
        )

    def _cloud(self, stamp_ns: int, frame: str, columns: Mapping[str, Array]) -> Any:
        """Points with columns as 32-bit numbers, x, y and z among them."""
        table = np.column_stack([np.asarray(column, dtype="<f4") for column in columns.values()])
        field = self._types["sensor_msgs/msg/PointField"]
        return self._types[CLOUD](
            header=self._header(stamp_ns, frame),
            height=1,
            width=len(table),
            fields=[field(name, 4 * place, _FLOAT32, 1) for place, name in enumerate(columns)],
            is_bigendian=False,
            point_step=4 * len(columns),
            row_step=4 * len(columns) * len(table),
            data=np.frombuffer(table.tobytes(), np.uint8),
            is_dense=True,
        )
