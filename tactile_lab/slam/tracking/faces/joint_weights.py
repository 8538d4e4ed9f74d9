"""Weighs contacts of which several share errors by their joint covariance, and finds these errors.

With S the own variances of the contacts and M their moves along their normals by one standard deviation of each shared
error, distances have the covariance S + M M'. Here all are in own standard deviations: S is the unit matrix.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np

from drivers.core.contacts import Array
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet


@dataclass(frozen=True)
class JointWeights:
    """Of some contacts.

    Attributes:
        moves: of each contact by each error that was taken out of their variances, own standard deviations, shape
            (n, m); m = 0 if none were.
    """

    moves: Array

    @classmethod
    def of(cls, contacts: ContactSet) -> Self:
        """Of contacts that say how errors move them."""
        shared = contacts.shared.of_count(len(contacts))
        return cls(shared.by_errors_m() / contacts.point_sigma_m[:, None])

    def whiten(self, distances: Array) -> Array:
        """Distances of the contacts, own standard deviations, or derivatives, made uncorrelated, shape (n, ...)."""
        return distances if self._root is None else np.asarray(self._root @ distances)

    def errors(self, distances: Array) -> Array:
        """The likeliest errors, standard deviations, shape (m,), by what the fit has left, shape (n,)."""
        return np.asarray(np.linalg.solve(self._information, self.moves.T @ distances))

    def unknown(self, information: Array, derivatives: Array) -> Array:
        """How unknowns follow what a fit leaves unknown of the errors, by standard normal variables, shape (p, m).

        Args:
            information: of the unknowns, the errors given, shape (p, p).
            derivatives: of the distances by the unknowns, shape (n, p).
        """
        both = -derivatives.T @ self.moves
        follow = -np.linalg.solve(information, both)
        left = self._information + both.T @ follow
        return np.asarray(follow @ np.linalg.inv(np.linalg.cholesky(left)).T)

    @property
    def _information(self) -> Array:
        """Of the errors, all else given, shape (m, m)."""
        return np.asarray(np.eye(self.moves.shape[1]) + self.moves.T @ self.moves)

    @cached_property
    def _root(self) -> Array | None:
        """Inverse root of the joint covariance, shape (n, n); None if nothing is shared."""
        if not self.moves.shape[1]:
            return None
        return np.linalg.inv(np.linalg.cholesky(np.eye(len(self.moves)) + self.moves @ self.moves.T))
