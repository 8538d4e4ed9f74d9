"""Reward of a candidate grasp, and the known share of the object (thesis section 4.5.2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from drivers.core.contacts import Array
from tactile_lab.slam.exploration.candidates import Candidate, ModelledObject, PredictedContacts, predict_contacts
from tactile_lab.slam.shape.surfaces.surface import Contour, SurfaceMesh

KNOWN_SIGMA_m = 0.003
"""A part of the surface counts as explored below this standard deviation (the thesis's accuracy at known poses)."""


@dataclass(frozen=True)
class RatedCandidate:
    """A candidate with what it is expected to touch and its reward."""

    candidate: Candidate
    contacts: PredictedContacts
    reward_m2: float


def variance_reward(contacts: PredictedContacts) -> float:
    """Equation 4.20: the sum of the field's variances at the predicted contacts, square metres."""
    return float(np.sum(contacts.variances_m2))


def rate(candidates: Sequence[Candidate], known: ModelledObject) -> list[RatedCandidate]:
    """All candidates by reward, the most promising first; equal rewards keep their order."""
    rated = []
    for candidate in candidates:
        contacts = predict_contacts(candidate, known)
        rated.append(RatedCandidate(candidate, contacts, variance_reward(contacts)))
    return sorted(rated, key=lambda item: -item.reward_m2)


def explored_share(surface: Contour | SurfaceMesh, threshold_m: float = KNOWN_SIGMA_m) -> float:
    """Share of the modelled contour's length or surface's area whose standard deviation is below a threshold.

    An edge or triangle counts with the mean of its corners' standard deviations. 0 for an empty surface.
    """
    sizes, sigma_m = _edges(surface) if isinstance(surface, Contour) else _triangles(surface)
    total = float(sizes.sum())
    return float(sizes[sigma_m < threshold_m].sum()) / total if total > 0 else 0.0


def _edges(contour: Contour) -> tuple[Array, Array]:
    lengths = np.linalg.norm(np.roll(contour.points_m, -1, axis=0) - contour.points_m, axis=1)
    return lengths, (contour.sigma_m + np.roll(contour.sigma_m, -1)) / 2


def _triangles(mesh: SurfaceMesh) -> tuple[Array, Array]:
    corners = mesh.vertices[mesh.faces]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    return areas, mesh.sigma_m[mesh.faces].mean(axis=1)
