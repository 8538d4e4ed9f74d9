"""From what is recorded to what viewers show, the same for a running session and for a recorded one.

A running session gives its messages for viewers, in their order. A recorded one gives those too, but its joints and
wrenches come from the raw bytes, which every recording has.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Callable, Iterator, Mapping

import numpy as np
from gtsam import Pose3, Rot3

from drivers.camera.frames import Detection
from drivers.core.contacts import Array
from drivers.shadow.model.kinematics import JOINTS
from sessions.recording.traffic import schemas, told
from sessions.rig_runtime.state_recording import BASE_JOINTS
from tactile_lab.outline_walls import wall
from tactile_lab.viewers.camera_pose import CameraPose
from tactile_lab.viewers.items import (
    Candidate,
    Candidates,
    Frames,
    Item,
    Joints,
    Lens,
    Loads,
    ObjectPose,
    Picture,
    Plain,
    Remark,
    SensorWrench,
    Surface,
    Touches,
)
from tactile_lab.viewers.robot import CAMERA, OBJECT, TRUE_OBJECT, WORLD, Placement, Robot

_PLANAR = [0, 1, 5]
"""Rows of a (6, 6) covariance that an estimate on the table has: x, y, yaw."""


class Story:
    """Keeps what later items need: the object's newest pose, the grasps so far, where the camera stands.

    Args:
        robot: of the session.
        camera: finds the camera's place in its pictures; None for a rig without one.
    """

    def __init__(self, robot: Robot, camera: CameraPose | None = None) -> None:
        self.robot = robot
        self._camera = camera
        self._fixed: dict[str, Placement] = {}
        self._objects: dict[str, Pose3] = {}
        self._estimate: Pose3 | None = None
        self._grasps: list[int] = []

    def begin(self, stamp_ns: int) -> Iterator[Item]:
        """What never changes."""
        yield self._lasting(stamp_ns, *self.robot.fixed())

    def state(self, stamp_ns: int, joints_rad: Array, base_q: Array) -> Iterator[Item]:
        """Hand and positioner moved: joints (24,) in radians, coordinates (6,) in metres and radians."""
        positions = self.robot.positions(joints_rad, base_q)
        yield Joints(stamp_ns, positions)
        objects = [Placement(WORLD, name, pose) for name, pose in self._objects.items()]
        yield Frames(stamp_ns, (*self.robot.moving(positions), *objects))

    def wrench(self, stamp_ns: int, finger: str, wrench: Array) -> Iterator[Item]:
        """A force sensor's raw wrench, shape (6,), N and N m."""
        yield SensorWrench(stamp_ns, finger, self.robot.sensor_frame(finger), wrench[:3], wrench[3:])

    def picture(self, stamp_ns: int, encoded: bytes, found: Detection | None = None) -> Iterator[Item]:
        """A camera picture, and the markers in it if they are known. The first that shows the world marker determines
        the camera's pose.
        """
        yield Picture(stamp_ns, encoded)
        if self._camera is not None and (pose := self._camera.first_sight(encoded, found)) is not None:
            yield self._lasting(stamp_ns, Placement(WORLD, CAMERA, pose))

    def _lasting(self, stamp_ns: int, *placements: Placement) -> Frames:
        """All that never move so far: who comes late, or jumps in a recording, is given the newest message alone."""
        self._fixed |= {one.child: one for one in placements}
        return Frames(stamp_ns, tuple(self._fixed.values()), lasting=True)

    def message(self, topic: str, data: bytes, stamp_ns: int) -> Iterator[Item]:
        """A recorded message; topics that viewers do not need give nothing. Raises ValueError for invalid content."""
        read = _READERS.get(topic)
        finger = _finger_of(topic)
        if read is None and finger is None:
            return
        try:
            content = json.loads(data)
            if read is not None:
                yield from read(self, stamp_ns, content)
            elif finger is not None:
                yield from self.wrench(
                    told.stamp_ns(content), finger, np.array([*content["force_N"], *content["torque_Nm"]])
                )
        except (KeyError, TypeError, AttributeError, IndexError) as error:
            raise ValueError(f"{topic}: {error!r}") from error

    # --- one topic each ----------------------------------------------------------------------------------------

    def _joints(self, stamp_ns: int, content: Plain) -> Iterator[Item]:
        positions = {joint["name"]: joint["position"] for joint in content["joints"]}
        joints_rad, base_q = ([positions.get(name, 0.0) for name in names] for names in (JOINTS, BASE_JOINTS))
        yield from self.state(stamp_ns, np.array(joints_rad, dtype=float), np.array(base_q, dtype=float))

    def _loads(self, stamp_ns: int, content: Plain) -> Iterator[Item]:
        frames = {finger: self.robot.distal_link(finger) for finger in content["load_N"]}
        yield Loads(stamp_ns, content["load_N"], frames)

    def _contacts(self, stamp_ns: int, content: Plain) -> Iterator[Item]:
        index, touches = told.grasp(content)
        gone = tuple(number for number in self._grasps if number >= index)
        self._grasps = [*(number for number in self._grasps if number < index), index]
        yield Touches(stamp_ns, index, touches, gone)

    def _slam_pose(self, stamp_ns: int, content: Plain) -> Iterator[Item]:
        self._estimate = told.pose(content)
        yield from ()  # told with its covariance, which comes next

    def _slam_state(self, stamp_ns: int, content: Plain) -> Iterator[Item]:
        if (pose := self._estimate) is None:
            return
        self._estimate, self._objects[OBJECT] = None, pose
        yield ObjectPose(stamp_ns, pose, _in_six(told.covariance(content)))
        yield Frames(stamp_ns, (Placement(WORLD, OBJECT, pose),))

    def _surface(self, stamp_ns: int, content: Plain) -> Iterator[Item]:
        found = told.surface(content)
        vertices_m, triangles, sigma_m = found.vertices_m, found.faces, found.sigma_m
        if found.dimension == 2 and len(vertices_m):
            vertices_m, triangles, sigma_m = wall(vertices_m, found.origin_height_m, sigma_m)
        yield Surface(stamp_ns, vertices_m, triangles, sigma_m, found.explored)

    def _plan(self, stamp_ns: int, content: Plain) -> Iterator[Item]:
        text = f"next: {content['closing']} ({content['reason']})"
        yield Candidates(stamp_ns, (Candidate(_grasp_frame(content), None, True),), text)

    def _decision(self, stamp_ns: int, content: Plain) -> Iterator[Item]:
        chosen = content.get("chosen")
        listed = enumerate(content["candidates"])
        found = tuple(Candidate(_grasp_frame(one), one.get("score"), place == chosen) for place, one in listed)
        yield Candidates(stamp_ns, found, f"{content['policy']}: {content['reason']}")

    def _truth(self, stamp_ns: int, content: Plain) -> Iterator[Item]:
        self._objects[TRUE_OBJECT] = pose = told.pose(content)
        yield ObjectPose(stamp_ns, pose, true=True)

    def _image(self, stamp_ns: int, content: Plain) -> Iterator[Item]:
        yield from self.picture(stamp_ns, base64.b64decode(content["data"]))

    def _lens(self, stamp_ns: int, content: Plain) -> Iterator[Item]:
        matrix = np.array(content["K"], dtype=float).reshape(3, 3)
        yield Lens(stamp_ns, matrix, tuple(content["D"]), (content["width"], content["height"]))

    def _remark(self, stamp_ns: int, content: Plain) -> Iterator[Item]:
        yield Remark(stamp_ns, int(content["level"]), str(content["name"]), str(content["message"]))


_READERS: Mapping[str, Callable[[Story, int, Plain], Iterator[Item]]] = {
    schemas.JOINTS_TOPIC: Story._joints,
    schemas.LOADS_TOPIC: Story._loads,
    schemas.CONTACTS_TOPIC: Story._contacts,
    schemas.SLAM_POSE_TOPIC: Story._slam_pose,
    schemas.SLAM_STATE_TOPIC: Story._slam_state,
    schemas.SLAM_SURFACE_TOPIC: Story._surface,
    schemas.PLAN_TOPIC: Story._plan,
    schemas.DECISION_TOPIC: Story._decision,
    schemas.TRUTH_POSE_TOPIC: Story._truth,
    schemas.IMAGE_TOPIC: Story._image,
    schemas.CAMERA_TOPIC: Story._lens,
    schemas.LOG_TOPIC: Story._remark,
}

TRUTH_TOPICS = frozenset({schemas.TRUTH_POSE_TOPIC, schemas.TRUTH_CONTACTS_TOPIC})
"""Not for those who watch a running session: nobody may decide by them."""

STORY_TOPICS = frozenset(_READERS)


def is_shown(topic: str) -> bool:
    """Whether a message of this topic gives viewers anything."""
    return topic in STORY_TOPICS or _finger_of(topic) is not None


def _finger_of(topic: str) -> str | None:
    """The finger of a wrench's topic; None for any other."""
    is_wrench = topic.startswith("/ft/") and topic.endswith("/wrench")
    return topic.split("/")[2] if is_wrench else None


def _in_six(planar: Array | None) -> Array | None:
    """The (6, 6) form of a covariance of x, y, yaw."""
    if planar is None:
        return None
    full = np.zeros((6, 6))
    full[np.ix_(_PLANAR, _PLANAR)] = planar
    return full


def _grasp_frame(content: Plain) -> Pose3:
    place = [float(content[name]) for name in ("x_m", "y_m", "height_m")]
    return Pose3(Rot3.Yaw(float(content["yaw_rad"])), np.array(place))
