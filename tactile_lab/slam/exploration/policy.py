"""The interface of policies: their input, their answer, and the default if there is nothing to choose.

A policy sees candidate grasps and the present belief, and never the truth. It answers with a :class:`Decision`: one
candidate, or none, with the score of each and the reason in a sentence. Policies are made by name, see
:func:`tactile_lab.slam.exploration.policies.make_policy`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from dataclasses import field as default
from typing import Literal, Protocol

import numpy as np
from gtsam import Pose2
from numpy.typing import NDArray

from drivers.core.contacts import Array
from tactile_lab.slam.exploration.candidates import Candidate
from tactile_lab.slam.shape.fields.field_grid import Field
from tactile_lab.slam.shape.surfaces.surface import Contour, SurfaceMesh

_FACES_THE_TABLE = -0.7
"""Largest z of a normal there."""

Indices = NDArray[np.int64]
Outcome = Literal["grasp", "stop", "nothing"]


@dataclass(frozen=True)
class Surface:
    """The estimated surface in one form for the plane and for space, object frame.

    Attributes:
        points_m: vertices, shape (n, d).
        normals: outward unit normals there, shape (n, d).
        sigma_m: standard deviation along the normal, shape (n,).
        cells: vertex indices of the edges (d = 2) or triangles (d = 3), shape (m, d).
    """

    points_m: Array
    normals: Array
    sigma_m: Array
    cells: Indices

    @classmethod
    def of(cls, extracted: Contour | SurfaceMesh) -> Surface:
        """From an extracted contour or mesh."""
        if isinstance(extracted, SurfaceMesh):
            return cls(extracted.vertices, extracted.normals, extracted.sigma_m, extracted.faces)
        points, count = extracted.points_m, len(extracted.points_m)
        along = np.roll(points, -1, axis=0) - np.roll(points, 1, axis=0)
        lengths = np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-12)
        normals = np.column_stack([along[:, 1], -along[:, 0]]) / lengths
        cells = np.column_stack([np.arange(count), np.roll(np.arange(count), -1)])
        return cls(points, normals, extracted.sigma_m, cells.astype(np.int64))

    @property
    def sizes(self) -> Array:
        """Length of the contour or area of the surface that belongs to each vertex, shape (n,), m or m^2."""
        corners = self.points_m[self.cells]
        edges = corners[:, 1:] - corners[:, :1]
        sizes = np.sqrt(np.maximum(np.linalg.det(edges @ edges.transpose(0, 2, 1)), 0.0)) / (self.cells.shape[1] - 1)
        shares = np.repeat(sizes / self.cells.shape[1], self.cells.shape[1])
        return np.asarray(np.bincount(self.cells.ravel(), shares, minlength=len(self.points_m)), dtype=float)

    def touchable(self, origin_height_m: float) -> NDArray[np.bool_]:
        """Which vertices fingers could touch, shape (n,): not those that face the table or are below it.

        Args:
            origin_height_m: height of the object frame's origin over the table.
        """
        if self.points_m.shape[1] == 2:
            return np.ones(len(self.points_m), dtype=bool)
        return (self.normals[:, 2] > _FACES_THE_TABLE) & (self.points_m[:, 2] > -origin_height_m)


def _nothing_2d() -> Array:
    return np.empty((0, 2))


@dataclass(frozen=True)
class RivalObject:
    """The object as it is if an alternative to the estimate is right.

    Attributes:
        surface: in this alternative's object frame.
        world_T_object: its pose on the table when the next grasp closes.
        probability: of the alternative.
        displaced: number of contacts that it places elsewhere.
    """

    surface: Surface
    world_T_object: Pose2
    probability: float
    displaced: int


@dataclass(frozen=True)
class Belief:
    """The belief by which a grasp is chosen. Points are in the object frame, metres.

    Attributes:
        field: the implicit surface.
        surface: extracted from it; None if the contacts enclose nothing yet.
        contacts_m, normals: all contacts so far with their outward normals, shape (n, d).
        grasp_indices: which grasp each contact belongs to, shape (n,); the largest is the latest.
        world_T_object: estimated pose of the object on the table.
        pose_covariance: of the present estimate (x m, y m, yaw rad) in the world, shape (3, 3).
        particles: possible poses when the next grasp closes, rows (x, y, yaw) in the world, shape (p, 3):
            the present particles, moved as it may move until then. Empty if there are none: then the Gaussian is used.
        weights: of the particles, summing to one, shape (p,).
        displacements_m: sampled surfaces: how far each vertex of ``surface`` moves along its normal, shape (s, n).
        missed_m: where contacts were expected and fingers met nothing, shape (k, d).
        origin_height_m: height of the object frame's origin over the table.
        grasps_left: how many grasps the session may still make; None for no limit.
        rivals: the object under alternatives to the estimate.
    """

    field: Field
    surface: Surface | None
    contacts_m: Array
    normals: Array
    grasp_indices: Indices
    world_T_object: Pose2
    pose_covariance: Array = default(default_factory=lambda: np.zeros((3, 3)))
    particles: Array = default(default_factory=lambda: np.empty((0, 3)))
    weights: Array = default(default_factory=lambda: np.empty(0))
    displacements_m: Array = default(default_factory=_nothing_2d)
    missed_m: Array = default(default_factory=_nothing_2d)
    origin_height_m: float = 0.0
    grasps_left: int | None = None
    rivals: tuple[RivalObject, ...] = ()

    @property
    def dimension(self) -> int:
        """2 for a contour, 3 for a surface."""
        return int(self.contacts_m.shape[1])

    @property
    def latest_contacts(self) -> NDArray[np.bool_]:
        """Which contacts belong to the latest grasp, shape (n,)."""
        return np.asarray(self.grasp_indices == self.grasp_indices.max(initial=-1))


@dataclass(frozen=True)
class Decision:
    """A policy's answer.

    Attributes:
        policy: its name.
        outcome: "grasp"; "stop", no further gain, or no grasp left; "nothing", no feasible candidate, so that the
            caller does something else (re-orients the object, or follows its fixed rule).
        chosen: index of the candidate, None unless the outcome is "grasp".
        scores: of every candidate, the higher the better; minus infinity for those that cannot be used.
        reason: one sentence.
        promised_gain: expected gain of the chosen candidate, in the policy's own unit; None if it has none.
        failure: what is wrong with the policy itself; empty for a valid answer.
    """

    policy: str
    outcome: Outcome
    chosen: int | None
    scores: tuple[float, ...]
    reason: str
    promised_gain: float | None = None
    failure: str = ""


class Policy(Protocol):
    """Chooses the next grasp."""

    @property
    def name(self) -> str:
        """The name used by the command line and in recordings."""

    def choose(self, candidates: Sequence[Candidate], belief: Belief, rng: np.random.Generator) -> Decision:
        """The next grasp, or why there is none. Never raises, whatever the belief contains."""


def nothing_to_choose(name: str, candidates: Sequence[Candidate], belief: Belief) -> Decision | None:
    """The decision if there is no choice: the budget is spent, or there is no candidate."""
    if belief.grasps_left is not None and belief.grasps_left <= 0:
        scores = (float("-inf"),) * len(candidates)
        return Decision(name, "stop", None, scores, "the budget of grasps is spent")
    if not candidates:
        return Decision(name, "nothing", None, (), "no candidate can be reached: the object has to be moved first")
    return None


def surface_to_foresee(
    name: str, candidates: Sequence[Candidate], belief: Belief, rng: np.random.Generator
) -> Surface | Decision:
    """The surface by which a policy predicts contacts, or the decision if it has no choice or no surface."""
    if settled := nothing_to_choose(name, candidates, belief):
        return settled
    if belief.surface is None:
        why = "the contacts enclose nothing yet, so nothing can be foreseen"
        return best_of(name, np.zeros(len(candidates)), why, rng)
    return belief.surface


def best_of(name: str, scores: Array, reason: str, rng: np.random.Generator) -> Decision:
    """The candidate with the highest score; ties are broken at random, which the reason says.

    Args:
        name: of the policy.
        scores: one per candidate; minus infinity or NaN for infeasible ones.
        reason: for the winner, a sentence.
        rng: breaks ties.
    """
    usable = np.where(np.isnan(scores), -np.inf, scores)
    shown = tuple(float(score) for score in usable)
    if not np.isfinite(usable).any():
        return Decision(name, "nothing", None, shown, "no candidate is expected to touch the object")
    best = np.flatnonzero(usable >= usable.max() - 1e-9 * abs(usable.max()))
    chosen = int(rng.choice(best)) if len(best) > 1 else int(best[0])
    if len(best) > 1:
        equals = f"all {len(best)}" if len(best) == len(scores) else f"{len(best)} of {len(scores)}"
        reason = f"{reason}; {equals} candidates promise the same, chosen among them by chance"
    return Decision(name, "grasp", chosen, shown, reason, float(usable[chosen]))
