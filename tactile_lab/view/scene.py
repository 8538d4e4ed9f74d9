"""The visible state of a session, built from the messages for viewers."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from gtsam import Pose3

from drivers.camera.packet import picture_of
from drivers.core.contacts import Array
from sessions.perception.interpreter import CAMERA_LINK
from sessions.recording.traffic import schemas, told
from sessions.recording.traffic.foxglove import pose_of
from sessions.recording.traffic.told import ToldSurface
from tactile_lab.view.course import ShownCourse

PALM = "palm"
WIZARD_TOPIC = "/wizard"
"""Topic of a calibration wizard's panel; only for a page, not recorded."""
MESSAGES = 6
"""Number of log events shown."""


@dataclass(frozen=True)
class ShownGrasp:
    """The contacts of one grasp.

    Attributes:
        index: from 0.
        fingers: of the contacts.
        points_world_m, normals_world: shape (n, 3), as measured.
        forces_N: shape (n,).
        world_T_object: the pose that the estimation gave the grasp; None before that.
    """

    index: int
    fingers: tuple[str, ...]
    points_world_m: Array
    normals_world: Array
    forces_N: Array
    world_T_object: Pose3 | None = None

    @property
    def points_object_m(self) -> Array | None:
        """The contacts in the object frame, shape (n, 3)."""
        if self.world_T_object is None:
            return None
        return np.array([self.world_T_object.transformTo(point) for point in self.points_world_m]).reshape(-1, 3)


@dataclass
class Scene:
    """The newest state.

    Attributes:
        world_T_palm, world_T_distal: the hand.
        loads_N: contact force of each fingertip; None if there is no usable reading.
        grasps: the contacts so far.
        world_T_object, covariance: the pose, and that of its x, y (m) and yaw (rad).
        surface: as estimated.
        plan: the next grasp, as :meth:`sessions.motion.grasp_plan.GraspPlan.as_plain` gives it.
        steps: the estimator's verdict on each grasp.
        guide: the panel of a guided session.
        course: forces over time, and uncertainty over the grasps.
        picture: the camera's newest picture, encoded as JPEG or PNG.
        wizard: the panel of a calibration wizard: question, lines, tables.
        messages: the newest events.
        stamp_ns: session clock of the newest message.
        dropped: messages dropped because the page did not keep up.
        changed: names of the attributes that changed since they were drawn.
    """

    world_T_palm: Pose3 | None = None
    world_T_distal: dict[str, Pose3] = field(default_factory=dict)
    loads_N: dict[str, float | None] = field(default_factory=dict)
    grasps: list[ShownGrasp] = field(default_factory=list)
    world_T_object: Pose3 | None = None
    covariance: Array | None = None
    surface: ToldSurface | None = None
    plan: dict[str, Any] = field(default_factory=dict)
    steps: dict[int, dict[str, Any]] = field(default_factory=dict)
    guide: dict[str, Any] = field(default_factory=dict)
    course: ShownCourse = field(default_factory=ShownCourse)
    picture: bytes = b""
    wizard: dict[str, Any] = field(default_factory=dict)
    messages: list[str] = field(default_factory=list)
    stamp_ns: int = 0
    dropped: int = 0
    changed: set[str] = field(default_factory=set)

    @property
    def trust(self) -> dict[str, Any]:
        """How far to trust the newest estimate, from its message; empty if it does not say."""
        newest = self.steps[max(self.steps)] if self.steps else {}
        return newest if "status" in newest else {}

    @property
    def next_plan(self) -> dict[str, Any]:
        """The plan, unless its grasp has been measured already."""
        measured = self.grasps[-1].index if self.grasps else -1
        return self.plan if self.plan.get("index", 0) > measured else {}

    def take(self, topic: str, data: bytes, stamp_ns: int) -> None:
        """Process one message; topics that are not shown are ignored. Raises ValueError for invalid content."""
        if topic == CAMERA_PACKETS:
            self._take_picture(data)
            return
        read = _READERS.get(topic)
        if read is None:
            return
        self.stamp_ns = max(self.stamp_ns, stamp_ns)
        try:
            read(self, json.loads(data))
        except (KeyError, TypeError, AttributeError, IndexError) as error:
            raise ValueError(f"{topic}: {error!r}") from error
        if topic == schemas.LOADS_TOPIC:
            self.course.take_forces(stamp_ns, self.loads_N)

    def _take_picture(self, packet: bytes) -> None:
        """Keep the picture in a packet of the camera, if it has one."""
        if picture := picture_of(packet):
            self.picture = picture
            self.changed.add("picture")


def _hand(scene: Scene, content: dict[str, Any]) -> None:
    for item in content["transforms"]:
        pose = pose_of(item["translation"], item["rotation"])
        if item["child_frame_id"] == PALM:
            scene.world_T_palm = pose
        else:
            scene.world_T_distal[item["child_frame_id"]] = pose
    scene.changed.add("hand")


def _loads(scene: Scene, content: dict[str, Any]) -> None:
    scene.loads_N = {str(finger): load_N for finger, load_N in content["load_N"].items()}
    scene.changed.add("hand")


def _grasp(scene: Scene, content: dict[str, Any]) -> None:
    index, touches = told.grasp(content)
    shown = ShownGrasp(
        index=index,
        fingers=tuple(touch.finger for touch in touches),
        points_world_m=np.array([touch.point_world_m for touch in touches]).reshape(-1, 3),
        normals_world=np.array([touch.normal_world for touch in touches]).reshape(-1, 3),
        forces_N=np.array([touch.force_N for touch in touches]),
    )
    scene.grasps = [*(grasp for grasp in scene.grasps if grasp.index < index), shown]
    scene.changed.add("grasps")


def _slam_pose(scene: Scene, content: dict[str, Any]) -> None:
    scene.world_T_object = told.pose(content)
    scene.changed.add("object")


def _slam_state(scene: Scene, content: dict[str, Any]) -> None:
    """Process an estimate: the newest grasp was registered, or grasps were undone."""
    index = int(content["index"])
    scene.covariance = told.covariance(content)
    scene.course.take_pose(index, scene.covariance)
    scene.steps = {number: step for number, step in scene.steps.items() if number < index} | {index: content}
    placed = [_place(grasp, scene) if grasp.index == index else grasp for grasp in scene.grasps]
    scene.grasps = [grasp for grasp in placed if grasp.index <= index]
    scene.changed |= {"object", "grasps"}


def _place(grasp: ShownGrasp, scene: Scene) -> ShownGrasp:
    return ShownGrasp(
        grasp.index, grasp.fingers, grasp.points_world_m, grasp.normals_world, grasp.forces_N, scene.world_T_object
    )


def _surface(scene: Scene, content: dict[str, Any]) -> None:
    scene.surface = told.surface(content)
    scene.course.take_surface(scene.surface.sigma_m)
    scene.changed.add("object")


def _plan(scene: Scene, content: dict[str, Any]) -> None:
    scene.plan = content
    scene.changed.add("plan")


def _guide(scene: Scene, content: dict[str, Any]) -> None:
    scene.guide = content
    scene.changed.add("guide")


def _wizard(scene: Scene, content: dict[str, Any]) -> None:
    scene.wizard = {name: content[name] for name in ("question", "lines", "tables")}
    scene.changed.add("wizard")


def _event(scene: Scene, content: dict[str, Any]) -> None:
    scene.messages = [*scene.messages, str(content["message"])][-MESSAGES:]
    scene.changed.add("guide")


_READERS = {
    schemas.TRANSFORMS_TOPIC: _hand,
    schemas.LOADS_TOPIC: _loads,
    schemas.CONTACTS_TOPIC: _grasp,
    schemas.SLAM_POSE_TOPIC: _slam_pose,
    schemas.SLAM_STATE_TOPIC: _slam_state,
    schemas.SLAM_SURFACE_TOPIC: _surface,
    schemas.PLAN_TOPIC: _plan,
    schemas.GUIDE_TOPIC: _guide,
    schemas.LOG_TOPIC: _event,
    WIZARD_TOPIC: _wizard,
}
CAMERA_PACKETS = schemas.received_topic(CAMERA_LINK)
SHOWN_TOPICS = frozenset({*_READERS, CAMERA_PACKETS})
"""Whether a page needs this topic."""


def ellipse(covariance: Array, sigmas: float = 2.0, points: int = 48) -> Array:
    """Outline of the uncertainty of x, y about the origin, shape (points, 2), metres."""
    values, vectors = np.linalg.eigh(covariance[:2, :2])
    turns = np.linspace(0.0, 2.0 * math.pi, points)
    circle = np.column_stack([np.cos(turns), np.sin(turns)])
    return np.asarray(sigmas * circle * np.sqrt(np.maximum(values, 0.0)) @ vectors.T)
