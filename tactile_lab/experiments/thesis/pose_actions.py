"""Expected and actual information of three grasps about an uncertain pose: figures 4.6 and 4.7.

A rectangle of 10 x 6 cm was touched by some grasps, then pushed with full motion noise. Each action is predicted by the
estimate, as the policies of section 4.5.2.2 do; then it is executed on the object where it truly is.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from gtsam import Pose2

from drivers.core.contacts import Array
from tactile_lab.experiments.cells import Cell
from tactile_lab.experiments.data.explored_objects import FixedObject
from tactile_lab.experiments.data.outlines import OUTLINES_m
from tactile_lab.experiments.data.planar_hand import PlanarHand, planned_rays
from tactile_lab.experiments.data.sensing import SLIP_SIGMA_m, SLIP_SIGMA_rad
from tactile_lab.experiments.thesis.shape_drawings import millimetres
from tactile_lab.slam.exploration.candidates import Candidate
from tactile_lab.slam.exploration.information.particles import weighted_mean
from tactile_lab.slam.exploration.policy import Belief, Surface
from tactile_lab.slam.exploration.pose_policies import (
    Gain,
    PoseSwitchSettings,
    determinant_gain,
    kl_gain,
    simulate_weights,
    weigh,
)
from tactile_lab.slam.exploration.surface_policies import expected_contacts
from tactile_lab.slam.exploration.ten_candidates import TEN_PALMS, candidates_at
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet
from tactile_lab.slam.tracking.contacts.motion import compose, deviation

NOTHING = "none yet"
ACTIONS: Mapping[str, Array] = {
    "round an end": np.array([-0.045, 0.0, 0.0]),
    "along a long side": np.array([0.0, 0.0, np.pi / 2]),
    "at a corner": np.array([0.040, 0.020, np.deg2rad(215.0)]),
}
"""Palm poses relative to the object (x m, y m, yaw rad)."""
GAINS: Mapping[str, Gain] = {"kl": kl_gain, "det": determinant_gain}
"""Mutual information (4.5) is not among them: of particles that are equally probable before, it is the divergence."""
_SLIP = np.array([SLIP_SIGMA_m, SLIP_SIGMA_m, SLIP_SIGMA_rad])
_SETTINGS = PoseSwitchSettings(particles=20_000)
_GRASPS_BEFORE = 4
_SHOWN = 12
_OUTLINE_STEP = 3


@dataclass(frozen=True)
class PushedObject:
    """A rectangle that was explored and then pushed.

    Attributes:
        belief: about it, with particles of its pose.
        candidates: the actions.
        contacts: what each of them truly meets, in the world.
        truth: its pose, (x m, y m, yaw rad).
    """

    belief: Belief
    candidates: tuple[Candidate, ...]
    contacts: tuple[ContactSet, ...]
    truth: Array


def try_action(cell: Cell) -> dict[str, Any]:
    """An action, predicted and executed. Cell: action, or that there was none yet."""
    pushed = pushed_object(cell.seed)
    rng = np.random.default_rng([cell.seed, 47])
    simulated = simulate_weights(pushed.candidates, pushed.belief, _SETTINGS, rng)
    rows, before = simulated.rows, np.full(len(simulated.rows), 1.0 / len(simulated.rows))
    if cell["action"] == NOTHING:
        nothing = dict.fromkeys(GAINS, 0.0)
        return {**nothing, **_errors(rows, before, pushed.truth), "drawing": _drawing(pushed, rows, before, None, rng)}
    number = list(ACTIONS).index(cell["action"])
    foreseen = [before if weights is None else weights for weights in simulated.weights]
    gains = {name: [gain(rows, before, weights) for weights in foreseen] for name, gain in GAINS.items()}
    felt = [weigh(rows, contacts, pushed.belief, _SETTINGS) for contacts in pushed.contacts]
    missed_m = [_missed_m(rows, weights, pushed.truth) for weights in felt]
    return {
        **{name: float(found[number]) for name, found in gains.items()},
        **{f"{name}_chooses": bool(np.argmax(found) == number) for name, found in gains.items()},
        **_errors(rows, felt[number], pushed.truth),
        "is_best": bool(np.argmin(missed_m) == number),
        "drawing": _drawing(pushed, rows, foreseen[number], number, rng),
    }


def pushed_object(seed: int) -> PushedObject:
    """The rectangle after its exploration and its push."""
    rng = np.random.default_rng([seed, 46])
    hand = PlanarHand(OUTLINES_m["rectangle"], rng)
    thing = FixedObject(hand)
    for palm in TEN_PALMS[rng.permutation(len(TEN_PALMS))[:_GRASPS_BEFORE]]:
        thing.grasp(palm)
    known = thing.map()
    assert known is not None
    particles = _SLIP * rng.normal(size=(_SETTINGS.particles, 3))
    belief = replace(
        thing.belief(known, rng),
        particles=particles,
        weights=np.full(len(particles), 1.0 / len(particles)),
        pose_covariance=np.diag(_SLIP**2),
    )
    truth, palms = _SLIP * rng.normal(size=3), np.array(list(ACTIONS.values()))
    grasps = [hand.grasp(number, Pose2(*palm), Pose2(*truth)) for number, palm in enumerate(palms)]
    contacts = tuple(ContactSet.of_grasp(grasp, 2, 0.0) for grasp in grasps)
    return PushedObject(belief, candidates_at(palms, Pose2(), planned_rays()), contacts, truth)


def _errors(rows: Array, weights: Array, truth: Array) -> dict[str, float]:
    x_m, y_m, yaw_rad = deviation(weighted_mean(rows, weights)[None], truth)[0]
    return {"position_mm": 1e3 * float(np.hypot(x_m, y_m)), "rotation_deg": float(np.degrees(abs(yaw_rad)))}


def _missed_m(rows: Array, weights: Array, truth: Array) -> float:
    """Distance of the outline's corners from where they truly are, root mean square."""
    corners = np.pad(OUTLINES_m["rectangle"], ((0, 0), (0, 1)))
    apart = compose(weighted_mean(rows, weights), corners) - compose(truth, corners)
    return float(np.sqrt(np.mean(np.sum(apart[:, :2] ** 2, axis=1))))


def _drawing(
    pushed: PushedObject, rows: Array, weights: Array, number: int | None, rng: np.random.Generator
) -> dict[str, Any]:
    """Outlines at some of the poses that are left, and where the fingers of an action are expected."""
    belief = pushed.belief
    assert isinstance(belief.surface, Surface)
    outline = np.pad(belief.surface.points_m[::_OUTLINE_STEP], ((0, 0), (0, 1)))
    poses = rows[rng.choice(len(rows), _SHOWN, p=weights / weights.sum())]
    possible = [millimetres(compose(pose, outline)[:, :2]) for pose in poses]
    expected = expected_contacts(pushed.candidates, belief, belief.surface)
    dots = np.empty((0, 2)) if number is None else expected[number]
    return {"possible": possible, "estimate": millimetres(outline[:, :2]), "contacts": millimetres(dots)}
