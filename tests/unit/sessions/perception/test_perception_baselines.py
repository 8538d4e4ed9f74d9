"""Contacts, odometry and weighings from made samples, compared with before."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from gtsam import Pose2, Pose3, Rot3

from drivers.core.contacts import FINGERS, Grasp, StepSigma
from drivers.core.errors import TactileLabError
from drivers.core.fingertip import TipContact
from drivers.shadow.model.kinematics import JOINTS
from sessions.perception.approach_paths import TipSurface, approach_paths
from sessions.perception.carrying.carry import Carry
from sessions.perception.contact_world import HandGeometry, MountUncertainty
from sessions.perception.hand_odometry import HandOdometry
from sessions.perception.perception import PerceptionSettings
from sessions.perception.weighing.object_properties import ObjectProperties
from sessions.perception.weighing.weighing import Dragging, Hanging, dragging, hanging
from sessions.recording.session_events import EventKind, SessionEvent
from tests.support.baseline import assert_baseline
from tests.support.held_samples import POSTURE_rad, held_samples
from tests.support.session_fakes import (
    FakeBaseSample,
    FakeFrame,
    FakeHandSample,
    make_perception,
    make_rig,
    play_session,
)

ALMOST = {"rtol": 1e-5, "atol": 1e-9}


def geometry(side: str = "right") -> HandGeometry:
    palm = Pose3(Rot3.Ypr(0.4, 0.2, -0.1), np.array([0.1, -0.2, 0.3])).matrix()
    return HandGeometry(POSTURE_rad + 0.02 * np.arange(len(JOINTS)), palm, side)  # type: ignore[arg-type]


def test_contacts_in_the_world_and_their_covariances() -> None:
    tips = {
        finger: TipContact(
            point_distal_m=np.array([0.001 * at, -0.007, 0.02]),
            normal_distal=np.array([0.1 * at, 1.0, -0.2]),
            point_covariance_m2=np.diag([1e-8, 2e-8, 3e-8]),
            normal_sigma_rad=0.05,
            force_N=0.3 + at,
            torsion_Nm=0.0,
        )
        for at, finger in enumerate(FINGERS)
        if finger != "RF"
    }
    mount = MountUncertainty(
        Pose3(Rot3.Yaw(0.3), np.array([0.5, 0.1, 0.2])).matrix(), np.diag([1e-5, 2e-5, 3e-5, 1e-6, 2e-6, 3e-6])
    )
    told = {
        f"{side}, {'mount' if place else 'no mount'}": [
            vars(each) for each in geometry(side).contacts(tips, 0.01, place)
        ]
        for side in ("right", "left")
        for place in (None, mount)
    }
    assert_baseline("sessions/perception/contacts", told, **ALMOST)


def test_ways_of_the_fingertips() -> None:
    surface = TipSurface(np.array([0.008, 0.01, 0.013]), Pose3(Rot3.Roll(0.3), np.array([0.0, 0.0, 0.02])))
    begun = geometry().world_T_distal
    ended = begun.copy()
    ended[:, :3, 3] += np.outer([0.01, 0.0019, 0.0021, 0.02, 0.015], [0.6, 0.0, -0.8])
    touch = geometry().contacts({"FF": tip()}, 0.01, None)
    tips = {finger: surface for finger in FINGERS if finger != "TH"}
    assert_baseline(
        "sessions/perception/ways", {"ways": [vars(way) for way in approach_paths(begun, ended, tips, touch)]}, **ALMOST
    )


def tip() -> TipContact:
    return TipContact(np.array([0.0, -0.007, 0.02]), np.array([0.0, 1.0, 0.0]), 1e-8 * np.eye(3), 0.05, 0.6, 0.0)


def test_motions_of_the_hand_between_grasps() -> None:
    """Holds with and without what fingertips felt, one over a grasp, and grasps taken back."""
    odometry, told = HandOdometry(), list[Any]()
    felt = Carry(Pose2(0.01, 0.0, 0.1), StepSigma(0.003, 0.04), 0.0, 0.0, 0.0, 0.0, 0.0, ())
    poses = [Pose3(Rot3.Ypr(0.1 * n, 0.02 * n, 0.0), np.array([0.01 * n, -0.02 * n, 0.3])) for n in range(9)]

    def note() -> None:
        told.append([odometry.grasp_count, odometry.is_holding, odometry.motion.world.matrix()[:3]])

    def take(pose: Pose3, carry: Carry | None = None) -> None:
        motion = odometry.take(pose, carry)
        told.append([motion.world.matrix()[:3], None if motion.sigma is None else vars(motion.sigma), motion.is_rest])

    take(poses[0])
    odometry.begin(poses[0])
    odometry.end(poses[1], felt)
    odometry.begin(poses[1])
    odometry.end(poses[2], replace(felt, sigma=StepSigma(0.004, 0.03)))
    note()
    take(poses[2])
    odometry.begin(poses[3])
    take(poses[4], felt)
    odometry.end(poses[5])
    note()
    take(poses[6])
    odometry.undo()
    note()
    odometry.undo()
    note()
    take(poses[7])
    for wrong in (lambda: odometry.end(poses[8]), lambda: [odometry.undo() for _ in range(9)]):
        try:
            wrong()
        except TactileLabError as error:
            told.append(str(error))
    assert_baseline("sessions/perception/odometry", {"told": told})


class Scale:
    """A fingertip whose readings are wrenches."""

    drift = np.array([0.01, 0.02, 0.015, 5e-5, 6e-5, 7e-5])

    def wrenches(self, readings: np.ndarray, world_R_distal: np.ndarray) -> np.ndarray:
        return readings


def test_what_hangs_and_what_is_dragged() -> None:
    tips, told = {finger: Scale() for finger in FINGERS}, {}
    made = {
        "free": held_samples(0.0, 3.0, uneven=0.3),
        "held back": held_samples(0.5, 3.0, uneven=0.3),
        "hardly held back": held_samples(0.1, 3.0, uneven=0.3),
        "light": held_samples(0.0, 0.04, uneven=0.3),
        "diagonally": held_samples(0.3, 2.0, tilted=0.8, uneven=0.3),
    }
    for name, samples in made.items():
        found = hanging(samples, tips, "right", 0.01, 0.05)  # type: ignore[arg-type]
        told[name] = [vars(found), found.is_free, vars(dragging(samples, tips, "right"))]  # type: ignore[arg-type]
    still = replace(made["free"], world_T_forearm=np.tile(np.eye(4), (41, 1, 1)))
    told["still"] = [vars(dragging(still, tips, "right"))]  # type: ignore[arg-type]
    assert_baseline("sessions/perception/weighed", told, rtol=1e-5, atol=1e-6)


def test_what_is_known_of_an_object() -> None:
    free = Hanging(3.0, 0.05, np.array([0.1, 0.2]), np.array([0.001, 0.002]), 0.05)
    chance = np.random.default_rng(3)
    told = {}
    known = ObjectProperties()
    for name, add in {
        "nothing": lambda: None,
        "dragged": lambda: known.draggings.append((0, Dragging(1.2, 0.1, 0.4))),
        "held back": lambda: known.hangings.append((0, replace(free, held_back_N=0.17))),
        "hung": lambda: known.hangings.append((1, free)),
        "hung again": lambda: known.hangings.append((2, replace(free, weight_N=3.4, weight_sigma_N=0.1))),
        "slid a little": lambda: known.sliding.append((2, chance.random(39))),
        "slid": lambda: known.sliding.append((3, np.array([0.9]))),
        "dragged again": lambda: known.draggings.append((3, Dragging(0.9, 0.05, -9.0))),
        "taken back": lambda: known.undo(3),
        "all taken back": lambda: known.undo(0),
    }.items():
        add()
        values = (known.mass_kg, known.table_friction_N, known.table_friction)
        told[name] = {
            "words": known.in_words(),
            "values": [None if each is None else [each.value, each.sigma] for each in values],
            "tips": known.tip_friction_at_least,
            "friction": [repr(each) if each != each else each for each in vars(known.friction).values()],
            "centres": [vars(each) for each in known.centres],
            "known": known.is_known,
        }
    assert_baseline("sessions/perception/properties", told)


def test_a_session_of_fakes() -> None:
    """Grasps of a rig without physics, some of its messages damaged."""
    rig = make_rig(seed=4, damage=0.05)
    grasps = play_session(rig)
    interpreter, seen = rig.interpreter, rig.interpreter.perception
    told = {
        "grasps": [_plain(grasp) for grasp in grasps],
        "undecodable": dict(interpreter.undecodable),
        "newest": {name: heard.stamp_ns for name, heard in interpreter.newest.items()},
        "loads": seen.loads_N(),
        "dropped": [seen.touches.dropped, dict(seen.touches.drop_counts)],
        "counts": [seen.grasp_count, seen.is_holding, interpreter.clock.now_ns(), seen.hand_stamp_ns],
        "motion": seen.hand_motion.world.matrix()[:3],
        "losses": dict(rig.runtime.losses),
        "cycles": vars(rig.runtime.counts),
        "calls": rig.calls,
    }
    assert_baseline("sessions/perception/fakes", told, **ALMOST)


def _plain(grasp: Grasp) -> list[Any]:
    places = [[each.finger, each.point_world_m, each.normal_sigma_rad, each.force_N] for each in grasp.contacts]
    return [grasp.index, grasp.stamp_ns, places, grasp.world_T_palm.matrix()[:3], grasp.hand_motion_world.matrix()[:3]]


def test_events_and_what_they_complete() -> None:
    """Which events complete what, in and out of order, with pictures between them."""
    seen = make_perception(settings=PerceptionSettings(minimum_force_N=0.7))
    told: list[Any] = []
    sequence = (
        *("tare", "capture_end", "SAMPLES", "tare", "hold_end", "undo", "truth_frame", "FRAME", "truth_frame"),
        *("close_begin", "capture_begin", "FRAME", "SAMPLES", "truth_frame", "capture_end", "touch_end"),
        *("FRAME", "truth_frame", "hold_begin", "drag_end", "drag_begin", "SAMPLES", "drag_end", "hang_begin"),
        *("SAMPLES", "hang_end", "capture_begin", "capture_end", "hold_end", "capture_begin", "SAMPLES", "touch_end"),
        *("undo", "undo", "capture_begin", "undo", "capture_begin", "SAMPLES", "capture_end"),
    )
    for at, name in enumerate(sequence):
        now_ns = 10_000_000 * at
        if name == "SAMPLES":
            seen.on_hand(FakeHandSample(now_ns, POSTURE_rad))
            seen.on_base(FakeBaseSample(now_ns, 0.01 * np.arange(6.0) * at))
            for finger in FINGERS:
                seen.on_wrench(finger, [np.array([0.1, 0.2, 0.3 + 0.01 * at])])
        elif name == "FRAME":
            seen.on_frame(FakeFrame(now_ns, b"picture"))
        else:
            told.append([name, _outcome(seen, SessionEvent(EventKind(name), now_ns, FINGERS[1:]))])
    assert_baseline("sessions/perception/events", {"told": told}, **ALMOST)


def _outcome(seen: Any, event: SessionEvent) -> Any:
    try:
        found = seen.event(event)
    except TactileLabError as error:
        return str(error)
    if isinstance(found, Grasp):
        return _plain(found)
    return (
        None if found is None else [type(found).__name__, getattr(found, "grasp_index", None), str(vars(found))[:200]]
    )
