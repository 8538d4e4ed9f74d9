"""Carries of many kinds, from the steps of the fingertips to what is told of them: compared with before."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from gtsam import Pose2

from drivers.core.contacts import FINGERS, Contact, StepSigma
from drivers.core.fingertip import TipTouches
from drivers.shadow.model.kinematics import JOINTS, forearm_T_palm_matrix, palm_T_distal_matrices
from sessions.perception.carrying.carry import Carry, CarryOdometry
from sessions.perception.carrying.carry_record import CarryRecord, CarrySamples
from sessions.perception.carrying.forecast import IntendedCarry
from sessions.perception.carrying.friction_balance import Friction, MeasuredFriction
from sessions.perception.carrying.held_object import HeldObject
from sessions.perception.carrying.net_wrench import largest_net_N, net_wrench, upward_N
from sessions.perception.carrying.planar_motions import planar_matrices
from sessions.perception.carrying.tip_steps import TipSteps, tip_steps
from sessions.perception.touch_capture import Measured
from tests.support.baseline import assert_baseline
from tests.support.held_objects import BOX, DISC, carried
from tests.support.held_samples import POSTURE_rad

OBJECT, PALM = Pose2(0.02, 0.01, 0.15), Pose2(0.024, 0.012, 0.2)
DRAGGED = MeasuredFriction(table_N=1.4, table_sigma_N=0.2, tips_at_least=0.7, weight_N=3.0)


class SoftTip:
    """Its readings are the force on it and how far its contact is from its middle; it touches from 0.05 N on."""

    drift = np.array([0.01, 0.02, 0.03, 1e-4, 2e-4, 3e-4])

    def __init__(self, newest: np.ndarray) -> None:
        self.newest = newest

    def reading(self) -> np.ndarray:
        return self.newest

    def touches(self, readings: np.ndarray, world_R_distal: np.ndarray) -> TipTouches:
        forces = readings[:, :3]
        lengths = np.linalg.norm(forces, axis=1)
        void = np.isnan(lengths)
        normals = np.where(lengths[:, None] > 1e-9, -forces / np.maximum(lengths, 1e-9)[:, None], 0.0)
        points = np.array([0.0, -0.007, 0.02]) + readings[:, 3:]
        known = np.nan_to_num(lengths)
        return TipTouches(
            np.nan_to_num(points), np.nan_to_num(normals), 0.9 * known, np.nan_to_num(forces), known > 0.05, void
        )

    def wrenches(self, readings: np.ndarray, world_R_distal: np.ndarray) -> np.ndarray:
        return readings


def steps_of(name: str) -> TipSteps:
    """Steps of a carry in which something happens."""
    steps = carried(DISC if "disc" in name else BOX, object_motion=OBJECT, palm_motion=PALM, count=40)
    chance = np.random.default_rng(5)
    forces = steps.forces_N * (1.0 + 0.3 * np.sin(np.arange(40))[:, None] * np.arange(1, 6))
    steps = replace(steps, forces_N=np.maximum(forces, 0.1), sinking=0.2 * chance.standard_normal((40, 5)))
    steps = replace(steps, tangential_N=0.4 * steps.forces_N * chance.random((40, 5)))
    rows = np.arange(40)
    if name == "let go for a while":
        return replace(steps, forces_N=np.where((rows > 20)[:, None] & (rows < 28)[:, None], 0.0, steps.forces_N))
    if name == "held by one":
        alone = (rows > 30)[:, None] & (np.arange(5) != 2)[None]
        return replace(steps, forces_N=np.where(alone, 0.0, steps.forces_N))
    if name == "two silent":
        silent = (rows < 15)[:, None] & (np.arange(5) % 3 == 1)[None]
        return replace(steps, is_void=silent, forces_N=np.where(silent, 0.0, steps.forces_N))
    if name == "resisted":
        return replace(steps, net_forces_N=np.outer(np.where(rows > 10, 6.0, 0.3), [0.8, -0.6, 0.5]))
    if name == "pushed a little":
        return replace(steps, net_forces_N=np.outer(0.05 * rows, [0.6, 0.8, 0.0]))
    if name == "tips over":
        lean = 0.4 * rows / 40
        tilted = steps.normals.copy()
        tilted[..., 2] = lean[:, None] * steps.normals[..., 1]
        return replace(steps, normals=tilted / np.linalg.norm(tilted, axis=-1, keepdims=True))
    if name == "fingers slide":
        moves = steps.moves_m.copy()
        moves[:, 0, 0] += 0.0006
        moves[:, 4, 2] += 0.0003
        return replace(steps, moves_m=moves)
    return steps


KINDS = (
    *("held well", "a disc held well", "let go for a while", "held by one", "two silent", "resisted"),
    *("pushed a little", "tips over", "fingers slide"),
)


@pytest.mark.parametrize("measured", [MeasuredFriction(), DRAGGED], ids=["unknown", "dragged"])
def test_what_is_told_of_a_carry(measured: MeasuredFriction) -> None:
    told = {}
    for kind in KINDS:
        odometry = CarryOdometry({finger: SoftTip(np.zeros(6)) for finger in FINGERS if finger != "LF"}, "right", 1.3)
        odometry.measured = measured
        odometry.on_grasp(contacts())
        odometry.on_grasp(contacts(0.8))
        told[kind] = plain(odometry.carry(steps_of(kind)))
    assert_baseline(f"sessions/carrying/{'dragged' if measured is DRAGGED else 'unknown'}", told, rtol=1e-5, atol=1e-8)


def contacts(scale: float = 1.0) -> list[Contact]:
    return [
        Contact(finger, np.array([scale * x, scale * y, 0.03]), np.array([nx, ny, 0.0]), 1e-6 * np.eye(3), 0.1, 0.8)
        for finger, ((x, y), (nx, ny)) in BOX.items()
    ]


def plain(carry: Carry | None) -> Any:
    if carry is None:
        return None
    return {
        "motion": [carry.motion.x(), carry.motion.y(), carry.motion.theta()],
        "sigma": vars(carry.sigma),
        "slip": [carry.slip_m, carry.slip_rad],
        "times": [carry.loose_s, carry.single_s],
        "resisted_N": carry.resisted_N,
        "tilted_rad": carry.tilted_rad,
        "void": carry.void,
        "sliding": [len(carry.sliding), float(carry.sliding.sum())],
        "words": [carry.in_words(), carry.is_remarkable],
    }


def test_words_of_carries_at_their_limits() -> None:
    still = Carry(Pose2(), StepSigma(0.001, 0.01), 0.0, 0.0, 0.0, 0.0, 0.0, ())
    far_rad = float(np.deg2rad(5.0))
    changes: list[dict[str, Any]] = [
        *({"slip_m": 0.004}, {"slip_m": 0.00401}, {"slip_rad": far_rad}, {"slip_rad": 1.01 * far_rad}),
        *({"single_s": 0.05}, {"single_s": 0.06}, {"loose_s": 0.05}, {"loose_s": 0.06}),
        *({"tilted_rad": 0.3}, {"dropped_m": 0.012}, {"resisted_N": 2.0}, {"void": ("FF", "TH")}),
    ]
    told = [[change, (now := replace(still, **change)).in_words(), now.is_remarkable] for change in changes]
    assert_baseline("sessions/carrying/words", {"told": told})


def test_what_the_object_and_its_friction_are_taken_for() -> None:
    told = {}
    for name, spans in {"unknown": (), "small": (0.2,), "large": (4.0,), "two": (0.8, 1.2)}.items():
        odometry = CarryOdometry({}, "right", 2.0)
        for span in spans:
            odometry.on_grasp(contacts(span))
        odometry.on_grasp(contacts()[:1])
        odometry.measured = DRAGGED if name == "two" else odometry.measured
        closed = [vars(odometry.closed(StepSigma(0.001, 0.01), net_N)) for net_N in (0.5, 0.8, 1.8)]
        told[name] = {"friction": vars(odometry.friction), "foot_m": odometry.friction.foot_m, "closed": closed}
    for name, known in {
        "nothing": MeasuredFriction(),
        "dragged": DRAGGED,
        "hardly": MeasuredFriction(0.1, 0.2),
    }.items():
        told[f"bounds {name}"] = [known.least_table_N, known.most_table_N, vars(known.known(Friction()))]
    assert_baseline("sessions/carrying/assumed", told)


def samples(count: int = 60) -> CarrySamples:
    """A hand that turns, shifts and bends while its fingertips press more and more; one is silent for a while."""
    times = np.arange(count)
    joints = 0.4 + 0.05 * np.sin(0.1 * times[:, None] + np.arange(len(JOINTS)))
    forearm = np.tile(np.eye(4), (count, 1, 1))
    turn = 0.004 * times
    forearm[:, 0, 0], forearm[:, 0, 1], forearm[:, 1, 0], forearm[:, 1, 1] = (
        *(np.cos(turn), -np.sin(turn)),
        *(np.sin(turn), np.cos(turn)),
    )
    forearm[:, :3, 3] = np.column_stack([0.0004 * times, -0.0002 * times, np.full(count, 0.3)])
    frames = (forearm @ forearm_T_palm_matrix(joints, "right"))[:, None] @ palm_T_distal_matrices(joints, "right")
    readings = np.zeros((count, 5, 6))
    for at in range(5):
        pushes = np.array([0.1 * at, 0.8 if at == 4 else -0.3, 0.05 - 0.03 * at]) * (0.5 + 0.02 * times)[:, None]
        readings[:, at, :3] = np.einsum("nji,nj->ni", frames[:, at, :3, :3], pushes)
        readings[:, at, 3:] = 1e-4 * np.cos(0.2 * times + at)[:, None]
    readings[20:26, 3] = np.nan
    readings[40:, 2] *= 0.05
    return CarrySamples(1e7 * times, joints, forearm, readings)


def test_steps_and_net_wrench_of_samples() -> None:
    tips = {finger: SoftTip(0.1 * np.arange(6.0)) for finger in FINGERS if finger != "RF"}
    steps, wrench = (
        tip_steps(samples(), tips, "right"),
        net_wrench(samples(), tips, "right", 0.01 * np.ones(len(JOINTS))),
    )
    weights = np.cos(np.arange(len(steps)))
    told = {
        name: np.tensordot(weights, np.asarray(getattr(steps, name), dtype=float), axes=(0, 0))
        for name in ("points_m", "normals", "moves_m", "forces_N", "sinking", "tangential_N", "net_forces_N", "step_s")
    }
    told |= {"void": steps.is_void.sum(axis=0), "palm": steps.world_T_palm[[0, -1], :3], "felt": steps.felt.sum(axis=0)}
    told |= {name: getattr(wrench, name)[::12] for name in ("force_N", "moment_Nm", "palm_m")}
    told |= {"largest_N": largest_net_N(samples(), tips, "left"), "planar": planar_matrices(steps.world_T_palm)[::7]}
    told["upward_N"] = upward_N(tips, np.array([steps.world_T_palm[0, :3, :3]] * 5))
    assert_baseline("sessions/carrying/steps", told, rtol=1e-5, atol=1e-8)


def test_fingers_that_snap_shut_behind_an_object_do_not_move_it() -> None:
    """They lose it after 30 of 60 samples, and close by half a radian within 50 ms."""
    count, lost = 60, 30
    joints = np.tile(POSTURE_rad, (count, 1))
    frames = palm_T_distal_matrices(joints, "right")
    palm = forearm_T_palm_matrix(joints, "right")
    readings = np.zeros((count, 5, 6))
    for at in range(5):
        push_N = np.array([0.0, 2.0 if at == 4 else -0.5, 0.0])
        readings[:lost, at, :3] = (palm @ frames[:, at])[:lost, :3, :3].swapaxes(1, 2) @ push_N
    joints[lost:] += 0.5 * np.minimum(np.arange(1, count - lost + 1) / 5, 1.0)[:, None]
    held = CarrySamples(1e7 * np.arange(count), joints, np.tile(np.eye(4), (count, 1, 1)), readings)
    steps = tip_steps(held, {finger: SoftTip(np.zeros(6)) for finger in FINGERS}, "right")
    touching = steps.felt.all(axis=1)
    assert touching.tolist() == (np.arange(len(steps)) < lost // 2 - 1).tolist()
    np.testing.assert_allclose(steps.moves_m[touching], 0.0, atol=1e-12)


def test_a_carry_foretold() -> None:
    told = {}
    for name, (turn, shift_m) in {"short": (0.1, 0.005), "long": (0.6, 0.04)}.items():
        end = Pose2(0.1 + shift_m, -0.2 - shift_m / 2, 0.3 + turn)
        intended = IntendedCarry.of(contacts(), Pose2(0.1, -0.2, 0.3), end, 1.2, 0.02)
        for force_N in (0.5, 1.5):
            forces = dict.fromkeys(FINGERS[:4], force_N) | {"TH": 4 * force_N}
            for friction, weight_N in ((Friction(), float("nan")), (Friction(table_N=4.0, half_width_m=0.03), 3.0)):
                found = intended.forecast(force_N, forces, friction, weight_N)
                told[f"{name}, {force_N} N, {friction.table_N} N"] = [
                    *vars(found).values(),
                    found.slips,
                    found.in_words(),
                ]
    assert_baseline("sessions/carrying/foretold", told, rtol=1e-5, atol=1e-8)


def test_which_samples_of_a_held_object_count() -> None:
    tips = {finger: SoftTip(np.array([0.1, -0.8, 0.1, 1e-4, 2e-4, 3e-4])) for finger in FINGERS}
    record, taken = CarryRecord(tips), samples()
    record.begin()
    for row in range(60):
        record.take(int(1e7 * row) + 1_000_000 * (row % 3), taken.joints_rad[row], taken.world_T_forearm[row])
        record.take(int(1e7 * row) + 8_000_000, taken.joints_rad[row], taken.world_T_forearm[row])
    told: dict[str, Any] = {}
    for since_ns in (0, 100_000_000, 585_000_000, 590_000_000, 600_000_000, -199_000_000, -201_000_000):
        found = record.since(since_ns)
        told[f"since {since_ns}"] = None if found is None else [len(found.stamps_ns), *found.stamps_ns[[0, -1]]]
    for until_ns in (0, 10_000_000, 20_000_000, 10**9):
        found = taken.until(until_ns)
        told[f"until {until_ns}"] = None if found is None else [len(found.stamps_ns), found.readings[-1, 0, 0]]
    assert_baseline("sessions/carrying/record", told)


def test_an_object_from_closing_to_release() -> None:
    tips = {finger: SoftTip(np.array([0.1, -0.8, 0.1, 1e-4, 2e-4, 3e-4])) for finger in FINGERS}
    held, taken = HeldObject(tips, "right", 1.5), samples()
    told: dict[str, Any] = {}

    def move(first: int, last: int) -> None:
        for row in range(first, last):
            held.on_hand(int(1e7 * row), taken.joints_rad[row], taken.world_T_forearm[row])

    held.on_close(0)
    move(0, 12)
    held.on_capture(120_000_000)
    told["closing_N"] = held.closing_N
    move(12, 20)
    held.on_grasp(Measured(160_000_000, np.eye(4), tuple(contacts()), ()))
    held.on_hold(180_000_000)
    move(20, 45)
    told["height_m"], told["half way"] = held.contact_height_m, plain(held.carried_until(300_000_000))
    told["on"], told["watched"] = plain(held.end_hold(440_000_000)), held.is_watched
    move(45, 60)
    told["end"] = plain(held.end_hold())
    held.on_left()
    told["left"] = held.is_watched
    told["samples"] = None if held.samples is None else len(held.samples.stamps_ns)
    told["closed"] = [held.then_closed(None), vars(held.then_closed(StepSigma(0.001, 0.02)) or ())]
    assert_baseline("sessions/carrying/held", told, rtol=1e-5, atol=1e-8)
