"""Time of one decision: 72 candidates on a box with 300 contacts, with 5000 particles."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from gtsam import Pose2

from drivers.core.clock import MonotonicClock
from tactile_lab.benchmarks.components import Timing, TimingTable, median_ms
from tactile_lab.experiments.data.planar_hand import planned_rays
from tactile_lab.experiments.data.solids import solid
from tactile_lab.slam.exploration.candidates import Candidate, ClosingRays, ring_of_candidates
from tactile_lab.slam.exploration.policies import POLICIES, make_policy
from tactile_lab.slam.exploration.policy import Belief, Surface
from tactile_lab.slam.exploration.prediction import sampled_displacements
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.surfaces.sampling import sample_mesh_with_normals
from tactile_lab.slam.shape.surfaces.surface import extract_mesh

CONTACTS, PARTICLES, SAMPLED_SURFACES = 300, 5000, 16
YAWS, SHIFTS_m, HEIGHTS_m = 12, (-0.015, 0.0, 0.015), (0.02, 0.04)
_REPEATS, _MESH_m = 5, 0.007


def decision_table(contacts: int = CONTACTS, policies: tuple[str, ...] = tuple(POLICIES)) -> TimingTable:
    """Median time of one decision of each policy. Surfaces are sampled again each time; loops are compiled
    beforehand.
    """
    belief, candidates = box_belief(contacts), box_candidates()
    what = f"{len(candidates)} candidates, {contacts} contacts, {len(belief.particles)} particles"

    def timed(name: str) -> Timing:
        ms = median_ms(_decision(name, belief, candidates), MonotonicClock().now_ns, _REPEATS)
        return Timing(f"{name}: one decision", ms, _REPEATS, None, what)

    return TimingTable("Choosing the next grasp", tuple(timed(name) for name in policies))


def box_belief(contacts: int) -> Belief:
    """A box of 12 x 6 x 6 cm with this many contacts, its pose known to some millimetres and degrees."""
    points, normals = sample_mesh_with_normals(solid("box-12x6x6").mesh, contacts, seed=0)
    rng = np.random.default_rng(0)
    field = Gpis.fit(points + rng.normal(0.0, 0.001, points.shape), normals)
    particles = rng.normal(size=(PARTICLES, 3)) * [0.004, 0.004, 0.1]
    return Belief(
        field=field,
        surface=Surface.of(extract_mesh(field, resolution_m=_MESH_m)),
        contacts_m=points,
        normals=normals,
        grasp_indices=np.arange(contacts) // 5,
        world_T_object=Pose2(),
        pose_covariance=np.cov(particles.T),
        particles=particles,
        weights=np.full(PARTICLES, 1.0 / PARTICLES),
        origin_height_m=0.03,
    )


def box_candidates() -> tuple[Candidate, ...]:
    """Twelve yaws, three shifts and two heights around the box."""
    yaws = np.linspace(-np.pi, np.pi, YAWS, endpoint=False)
    closings = {f"{1e3 * height:.0f} mm": _rays(height) for height in HEIGHTS_m}
    return ring_of_candidates(np.zeros(2), yaws, np.array(SHIFTS_m), closings)


def _rays(height_m: float) -> ClosingRays:
    flat = planned_rays()
    return replace(flat, starts_m=flat.starts_m + np.array([0.0, 0.0, height_m]))


def _decision(name: str, belief: Belief, candidates: tuple[Candidate, ...]) -> Callable[[], None]:
    policy, rng = make_policy(name), np.random.default_rng(1)
    field, surface = belief.field, belief.surface
    assert isinstance(field, Gpis)
    assert surface is not None

    def decide() -> None:
        moves = sampled_displacements(field, surface, SAMPLED_SURFACES, rng)
        policy.choose(candidates, replace(belief, displacements_m=moves), rng)

    return decide
