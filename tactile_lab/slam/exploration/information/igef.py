"""Information gain estimation function: four metrics of a place on the surface, multiplied (thesis 4.11-4.15).

The thesis prints (4.14) with ``arccos(n, n*)``, an angle without its inner product; read here as the angle between
the normals. As the thesis observes, values are high near the contacts and low far away, regardless of what is known
there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydantic import Field
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from drivers.core.configuration import StrictModel
from drivers.core.contacts import Array
from tactile_lab.slam.exploration.policy import Surface

_SHORTEST_PATH_m = 0.001


class IgefSettings(StrictModel):
    """Parameters, "tuned manually" in the thesis, which does not give them; these suit objects of a hand's size.

    Attributes:
        far_m: sigma 1: beyond this distance a place counts as new.
        beside_m, beside_sigma_m: mu 3 and sigma 3: the favoured distance to what is explored, and its width.
        turn_sigma: sigma 4: preferred rotation of a fingertip, as twice the sine of half the angle.
    """

    far_m: float = Field(default=0.010, gt=0)
    beside_m: float = Field(default=0.015, ge=0)
    beside_sigma_m: float = Field(default=0.020, gt=0)
    turn_sigma: float = Field(default=1.0, gt=0)


@dataclass(frozen=True)
class IgefMetrics:
    """The four metrics at q places, each of shape (q,).

    Attributes:
        novelty: (4.11), 0 at a contact, towards 1 far away.
        nearness: (4.12), the inverse of the way along the surface, 1/m.
        continuity: (4.13), 1 at the favoured distance.
        alignment: (4.14), 1 where the fingertip need not turn.
    """

    novelty: Array
    nearness: Array
    continuity: Array
    alignment: Array

    @property
    def product(self) -> Array:
        """Equation 4.15."""
        return self.novelty * self.nearness * self.continuity * self.alignment

    @property
    def shape_only(self) -> Array:
        """Without the costs of the robot's motion, (4.12) and (4.14)."""
        return self.novelty * self.continuity


def igef(surface: Surface, contacts_m: Array, normals: Array, targets_m: Array, settings: IgefSettings) -> IgefMetrics:
    """The metrics of places on a surface against the nearest present contact, nearest along the surface.

    Args:
        surface: as estimated.
        contacts_m, normals: present contacts, shape (n, d), n at least 1.
        targets_m: places on the surface, shape (q, d).
        settings: parameters.
    """
    starts, goals = nearest_vertices(surface, contacts_m), nearest_vertices(surface, targets_m)
    ways = path_lengths(surface, starts)[:, goals]
    nearest = ways.argmin(axis=0)
    apart = np.linalg.norm(contacts_m[nearest] - targets_m, axis=1)
    path = np.maximum(np.maximum(ways.min(axis=0), apart), _SHORTEST_PATH_m)
    cosine = np.clip(np.sum(normals[nearest] * surface.normals[goals], axis=1), -1.0, 1.0)
    half_turn = np.sin(0.5 * np.arccos(cosine))
    return IgefMetrics(
        novelty=1.0 - np.exp(-((apart / settings.far_m) ** 2)),
        nearness=1.0 / path,
        continuity=np.exp(-(((apart - settings.beside_m) / settings.beside_sigma_m) ** 2)),
        alignment=np.exp(-2.0 * half_turn**2 / settings.turn_sigma**2),
    )


def nearest_vertices(surface: Surface, points_m: Array) -> Array:
    """Index of the vertex nearest to each point, shape (q,)."""
    return np.asarray(cKDTree(surface.points_m).query(points_m)[1])


def path_lengths(surface: Surface, sources: Array) -> Array:
    """Length of the shortest way along the edges from each source vertex to every vertex, shape (k, n), metres.

    Infinite between unconnected parts.
    """
    edges = np.vstack([surface.cells[:, [i, j]] for i, j in _sides(surface.cells.shape[1])])
    edges = np.unique(np.sort(edges, axis=1), axis=0)
    lengths = np.linalg.norm(surface.points_m[edges[:, 0]] - surface.points_m[edges[:, 1]], axis=1)
    count = len(surface.points_m)
    graph = csr_matrix((np.maximum(lengths, 1e-9), (edges[:, 0], edges[:, 1])), shape=(count, count))
    return np.asarray(dijkstra(graph, directed=False, indices=np.asarray(sources, dtype=int)))


def _sides(corners: int) -> list[tuple[int, int]]:
    return [(0, 1)] if corners == 2 else [(0, 1), (1, 2), (2, 0)]
