"""Every kind of message that a session has for viewers, made by its own recorder without a session."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from gtsam import Pose3, Rot3

from drivers.core.contacts import FINGERS, Contact, Grasp
from drivers.shadow.model.hand_form import RIGHT_HAND, HandForm
from drivers.shadow.model.kinematics import JOINTS, JOINT_LIMITS_rad
from sessions.recording.recorder import Level, Recorder
from sessions.rig_runtime.state_recording import BASE_JOINTS
from tactile_lab.viewers.items import Item
from tactile_lab.viewers.robot import Robot, Tip, make_robot
from tactile_lab.viewers.story import Story

STATE_ns = 1_000_000_007
TETRAHEDRON_m = [[0.0, 0.0, 0.0], [0.05, 0.0, 0.0], [0.0, 0.05, 0.0], [0.0, 0.0, 0.05]]
FACES = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]


@dataclass(frozen=True)
class Reading:
    """A force sensor's reading."""

    stamp_ns: int
    wrench: np.ndarray
    sent: int = 1
    measured: int = 1
    status: int = 0


class Kept:
    """Keeps messages as they were written."""

    def __init__(self) -> None:
        self.messages: list[tuple[str, bytes, int]] = []

    def write(self, topic: str, data: bytes, stamp_ns: int) -> None:
        self.messages.append((topic, data, stamp_ns))


def robot(form: HandForm = RIGHT_HAND) -> Robot:
    """A robot with all its fingertips and sensors, its mount off the world's origin."""
    place = Pose3(Rot3(), np.array([0.0, 0.0, 0.019]))
    tips = {finger: Tip(place, (0.0085, 0.0085, 0.013), Pose3(Rot3(), np.array([0, 0, 0.004]))) for finger in FINGERS}
    mount = Pose3(Rot3.Ypr(0.3, 0.0, 0.1), np.array([0.1, -0.2, 0.05]))
    fitted = {finger: tips[finger] for finger in form.fingers}
    return make_robot(form, mount, fitted, ((-1.0, 1.0),) * 6, (1.0, 0.8, 0.02))


def posture(form: HandForm = RIGHT_HAND, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Joints of the hand (24,), those that it lacks at 0, and of the positioner (6,)."""
    rng = np.random.default_rng(seed)
    joints = rng.uniform(*JOINT_LIMITS_rad.T)
    joints[[name not in form.joints for name in JOINTS]] = 0.0
    return joints, rng.uniform(-0.5, 0.5, 6)


def contacts(height_m: float = 0.02) -> tuple[Contact, ...]:
    """Three contacts of a grasp."""
    normals = np.array([[1.0, 0.0, 0.0], [-0.6, 0.8, 0.0], [0.0, 0.0, 1.0]])
    places = zip(("FF", "TH", "MF"), normals, strict=True)
    return tuple(
        Contact(finger, 0.03 * normal + [0.0, 0.0, height_m], normal, np.diag([1e-6, 4e-6, 9e-6]), 0.1, 0.5 * number)
        for number, (finger, normal) in enumerate(places, 1)
    )


def picture() -> bytes:
    """A small PNG without a marker."""
    return cv2.imencode(".png", np.full((24, 32), 128, np.uint8))[1].tobytes()


def told() -> list[tuple[str, bytes, int]]:
    """The messages: topic, data, stamp."""
    kept = Kept()
    recorder, (joints, base) = Recorder(kept), posture()
    matrix = np.array([[600.0, 0.0, 16.0], [0.0, 600.0, 12.0], [0.0, 0.0, 1.0]])
    recorder.camera(1, matrix, (0.1, 0.0, 0.0, 0.0, 0.0), (32, 24))
    recorder.joints(STATE_ns, dict(zip(JOINTS, joints, strict=True)), dict(zip(BASE_JOINTS, base, strict=True)))
    recorder.loads(STATE_ns, {"FF": 0.5, "TH": 0.0})
    recorder.wrench(STATE_ns, "FF", Reading(STATE_ns - 3, np.arange(1.0, 7.0)))
    recorder.plan(
        2 * STATE_ns,
        {"index": 0, "closing": "radial", "x_m": 0.0, "y_m": 0.1, "yaw_rad": 1.0, "height_m": 0.03, "reason": "first"},
    )
    frame = {"x_m": 0.01, "y_m": 0.0, "yaw_rad": 0.5, "height_m": 0.02, "closing": "radial"}
    recorder.decision(
        2 * STATE_ns,
        {
            "policy": "information",
            "reason": "most gain",
            "chosen": 1,
            "candidates": [{**frame, "score": None}, {**frame, "score": 2.5}],
        },
    )
    for stamp_ns, grasp in ((3 * STATE_ns, 0), (5 * STATE_ns, 1), (7 * STATE_ns, 1)):  # the second was undone once
        recorder.grasp(stamp_ns, Grasp(grasp, stamp_ns, contacts()), {})
        pose = Pose3(Rot3.Yaw(0.2), np.array([0.01, 0.02, 0.03]))
        recorder.slam(stamp_ns, pose, {"index": grasp, "verdict": "first"}, np.diag([1e-6, 4e-6, 1e-4]))
        surface = {"vertices_m": TETRAHEDRON_m, "faces": FACES, "sigma_m": [0.0, 0.005, 0.01, 0.02]}
        recorder.surface(stamp_ns, {**surface, "dimension": 3, "explored": 0.4, "origin_height_m": 0.03})
    recorder.image(8 * STATE_ns, picture())
    recorder.truth(8 * STATE_ns, Pose3(Rot3(), np.array([0.0, 0.0, 0.02])))
    recorder.log(8 * STATE_ns, Level.WARNING, "hand", "warm")
    recorder.joints(9 * STATE_ns, dict(zip(JOINTS, joints, strict=True)), dict(zip(BASE_JOINTS, base, strict=True)))
    return kept.messages


def items(model: Robot) -> list[Item]:
    """What viewers show of those messages."""
    story = Story(model)
    found = list(story.begin(0))
    for topic, data, stamp_ns in told():
        found += story.message(topic, data, stamp_ns)
    return found
