"""Errors that all contacts of one finger share during a session: more grasps do not reduce them.

The offsets of a finger's joint sensors move all its contacts in nearly the same direction. They are taken as one number
for each finger, how far it feels surfaces too far out or in, independent of the other fingers'.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import Array, Contact


@dataclass(frozen=True)
class SharedErrors:
    """Of some contacts; empty if unknown.

    Attributes:
        fingers: name of the finger of each contact, shape (n,).
        sigma_m: standard deviation of what each contact shares with the others of its finger, along its normal,
            shape (n,).
    """

    fingers: NDArray[np.str_]
    sigma_m: Array

    @classmethod
    def of(cls, contacts: Sequence[Contact], normals: Array) -> Self:
        """Of contacts with outward normals of shape (n, 3)."""
        given = [np.zeros((3, 3)) if (own := one.shared_covariance_m2) is None else own for one in contacts]
        variances = np.einsum("ni,nij,nj->n", normals, np.array(given).reshape(-1, 3, 3), normals)
        return cls(np.array([one.finger for one in contacts], dtype=np.str_), np.sqrt(np.maximum(variances, 0.0)))

    @classmethod
    def concatenate(cls, parts: Sequence[SharedErrors]) -> Self:
        """Of all contacts of the parts in order."""
        fingers = np.concatenate([part.fingers for part in parts])
        return cls(fingers, np.concatenate([part.sigma_m for part in parts]))

    def of_count(self, count: int) -> SharedErrors:
        """The same with an entry for each of this many contacts."""
        return self if len(self.fingers) == count else SharedErrors(np.full(count, ""), np.zeros(count))

    def select(self, mask: NDArray[np.bool_] | NDArray[np.intp]) -> SharedErrors:
        """Of the contacts picked by a boolean or index array."""
        return SharedErrors(self.fingers[mask], self.sigma_m[mask])

    def displacements_m(self) -> Array:
        """How one standard deviation of each finger's error moves each contact along its normal, shape (n, fingers)."""
        if not self.sigma_m.any():
            return np.zeros((len(self.fingers), 0))
        return np.asarray((self.fingers[:, None] == np.unique(self.fingers)) * self.sigma_m[:, None])

    def displacements_each_m(self) -> Array:
        """The same as if each contact had such an error of its own, shape (n, n)."""
        return np.diag(self.sigma_m) if self.sigma_m.any() else np.zeros((len(self.fingers), 0))


NO_SHARED_ERRORS = SharedErrors(np.empty(0, dtype=np.str_), np.empty(0))
