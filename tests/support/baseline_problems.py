"""Small fixed problems of the tracking whose results are compared with stored numbers."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any, Literal, TypeAlias

import numpy as np
from gtsam import Pose2, Pose3, Rot3

from drivers.core.contacts import Array, StepSigma
from drivers.core.poses import spatial
from tactile_lab.experiments.data import planar_data, spatial_data
from tactile_lab.experiments.data.carried_off import carried_off
from tactile_lab.experiments.data.sensing import SimulatedGrasps, with_finger_errors, without_paths
from tactile_lab.slam.shape.fields.settings import GpisSettings
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap, Moved, PlacedGrasp
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet
from tactile_lab.slam.tracking.contacts.pose_vectors import PLANAR
from tactile_lab.slam.tracking.contacts.spatial_pose_vectors import SPATIAL
from tactile_lab.slam.tracking.joint.hypotheses import Hypothesis

Kind: TypeAlias = Literal["plane", "table", "space"]
KINDS: tuple[Kind, ...] = ("plane", "table", "space")
"""Contacts in the plane; in space, of an object on a table; of one with six degrees of freedom."""

FELT = StepSigma(0.0015, 0.04)


@cache
def session(kind: Kind, shape: str = "", *, count: int = 5, seed: int = 3, wrong: float = 0.0) -> SimulatedGrasps:
    """Grasps of a rectangle, or of a block with a step; each finger feels surfaces 0.3 mm too far out or in."""
    data: SimulatedGrasps
    if kind == "plane":
        data = planar_data.simulate(shape or "rectangle", seed, count=count, outlier_share=wrong)
    else:
        motion: Literal["table", "free"] = "table" if kind == "table" else "free"
        given: dict[str, Any] = {"motion": motion, "count": count, "outlier_share": wrong}
        data = spatial_data.simulate(shape or "l-block", seed, **given)
    return with_finger_errors(data, 0.0003, np.random.default_rng(seed))


def felt(data: SimulatedGrasps, at: int, sigma: StepSigma = FELT) -> SimulatedGrasps:
    """The session with a step that the fingertips measured."""
    grasps = [replace(one, motion_sigma=sigma) if i == at else one for i, one in enumerate(data.grasps)]
    return replace(data, grasps=tuple(grasps))


def unheld(data: SimulatedGrasps, at: int) -> SimulatedGrasps:
    """The session with an object that the hand did not carry before a grasp, whatever happened to it."""
    grasps = [replace(one, hand_motion_world=Pose3()) if i == at else one for i, one in enumerate(data.grasps)]
    return replace(data, grasps=tuple(grasps))


def thrown(data: SimulatedGrasps, at: int) -> SimulatedGrasps:
    """The session with the object carried 8 cm off and turned before a grasp, unseen."""
    return carried_off(data, at, spatial(Pose2(0.07, -0.05, 0.9)))


def pathless(data: SimulatedGrasps) -> SimulatedGrasps:
    """The session of a hand that does not say how its fingers came."""
    return without_paths(data)


def true_placed(
    data: SimulatedGrasps, kind: Kind, *, off: float = 1.0, settings: GpisSettings | None = None
) -> ContactMap:
    """The grasps placed two millimetres and three degrees beside the truth, always the same way, the first at it."""
    space, dimension = (SPATIAL if kind == "space" else PLANAR), (2 if kind == "plane" else 3)
    sigmas = np.where(np.arange(space.size) < space.translations, 0.002, 0.05)
    placed = []
    for index, (grasp, pose) in enumerate(zip(data.grasps, data.world_T_body, strict=True)):
        row = space.motion(pose)
        step = off * (index > 0) * sigmas * np.cos(2.1 * np.arange(space.size) + 1.7 * index)
        covariance = np.diag(sigmas**2) * (0.1 + index)
        motion, sigma = space.motion(grasp.hand_motion_world), grasp.motion_sigma
        contacts = ContactSet.of_grasp(grasp, dimension, 0.0)
        placed.append(PlacedGrasp(contacts, space.move(row, step), covariance, motion, motion_sigma=sigma))
    return ContactMap(tuple(placed), settings or GpisSettings(), space)


@cache
def varied_map(kind: Kind, count: int = 5) -> ContactMap:
    """A trajectory in which much happens: a step that was felt, one left in place, one pushed, one free, a contact left
    out and, in the plane, a grasp aside.
    """
    data = unheld(felt(session(kind, count=count), 1), 2)
    known = true_placed(data, kind)
    changes: dict[int, dict[str, Any]] = {
        1: {"left_out": frozenset({1})},
        3: {"moved": Moved.PUSHED},
        4: {"moved": Moved.FREELY},
    }
    for index, change in changes.items():
        if index < count:
            known = known.with_placed(index, replace(known.placed[index], **change))
    return known


def told(one: Hypothesis) -> dict[str, Any]:
    """What a hypothesis says: its costs, and where its grasps are."""
    return {
        "costs": [one.misfit, one.intrusion, one.left_out, one.map.settled_cost],
        "poses": one.map.rows,
        "left out": [sorted(grasp.left_out) for grasp in one.map.placed],
        "moved": [how.value for how in one.map.moved],
        "kernel": kernel(one.map),
    }


def kernel(known: ContactMap) -> list[float]:
    """The parameters of a map's kernel."""
    return [known.settings.amplitude_m or 0.0, known.settings.length_m or 0.0]


def any_rows(kind: Kind, count: int) -> Array:
    """Pose vectors all over the place, the same everywhere."""
    size = 6 if kind == "space" else 3
    angles = np.cos(1.3 * np.arange(count * size) ** 1.1 + 0.4).reshape(count, size)
    lengths = np.where(np.arange(size) < (3 if kind == "space" else 2), 0.1, 1.9)
    return np.asarray(angles * lengths)


def turned_by(angle_rad: float) -> Pose3:
    """A tilt about no axis in particular."""
    return Pose3(Rot3.Expmap(angle_rad * np.array([0.6, -0.64, 0.48])), np.array([0.01, -0.02, 0.03]))
