"""Errors that all contacts of one finger share during a session: more grasps do not reduce them.

The offsets of a finger's joint sensors move all its contacts. Where a contact states only how much, they are taken as
one number for each finger, how far it feels surfaces too far out or in, independent of the other fingers', or as one
for all of them if it says so. Where it states how far each offset moves it, which depends on the finger's posture, they
are estimated at the end of a session (:mod:`resolved_errors`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import Array, Contact

ALL_FINGERS = "all"
"""In place of a finger's name: of an error that is the same for all fingers."""


@dataclass(frozen=True)
class SharedErrors:
    """Of some contacts; empty if unknown.

    Attributes:
        fingers: name of the finger of each contact, shape (n,), or :data:`ALL_FINGERS` where its error is theirs.
        sigma_m: standard deviation of what each contact shares with the others of its finger, along its normal,
            shape (n,); 0 where it was estimated and taken away.
        moves_m: how one standard deviation of each error of its finger moves each contact along its normal, shape
            (n, k); k = 0 if no contact says.
    """

    fingers: NDArray[np.str_]
    sigma_m: Array
    moves_m: Array = field(default_factory=lambda: np.empty((0, 0)))

    @classmethod
    def of(cls, contacts: Sequence[Contact], normals: Array) -> Self:
        """Of contacts with outward normals of shape (n, 3)."""
        given = np.array([_covariance_m2(one) for one in contacts]).reshape(-1, 3, 3)
        variances = np.einsum("ni,nij,nj->n", normals, given, normals)
        fingers = np.array([ALL_FINGERS if one.shared_by_all else one.finger for one in contacts], dtype=np.str_)
        return cls(fingers, np.sqrt(np.maximum(variances, 0.0)), _along(contacts, normals))

    @classmethod
    def concatenate(cls, parts: Sequence[SharedErrors]) -> Self:
        """Of all contacts of the parts in order."""
        fingers = np.concatenate([part.fingers for part in parts])
        columns = max(part.moves_m.shape[1] for part in parts)
        moves = [part._padded(columns) for part in parts]
        return cls(fingers, np.concatenate([part.sigma_m for part in parts]), np.concatenate(moves))

    def _padded(self, columns: int) -> Array:
        moves = np.zeros((len(self.fingers), columns))
        moves[: len(self.moves_m), : self.moves_m.shape[1]] = self.moves_m
        return moves

    def of_count(self, count: int) -> SharedErrors:
        """The same with an entry for each of this many contacts."""
        return self if len(self.fingers) == count else SharedErrors(np.full(count, ""), np.zeros(count))

    def select(self, mask: NDArray[np.bool_] | NDArray[np.intp]) -> SharedErrors:
        """Of the contacts picked by a boolean or index array."""
        return SharedErrors(self.fingers[mask], self.sigma_m[mask], self._padded(self.moves_m.shape[1])[mask])

    def displacements_m(self) -> Array:
        """How one standard deviation of each finger's error moves each contact along its normal, shape (n, fingers)."""
        if not self.sigma_m.any():
            return np.zeros((len(self.fingers), 0))
        return np.asarray((self.fingers[:, None] == np.unique(self.fingers)) * self.sigma_m[:, None])

    def displacements_each_m(self) -> Array:
        """The same as if each contact had such an error of its own, shape (n, n)."""
        return np.diag(self.sigma_m) if self.sigma_m.any() else np.zeros((len(self.fingers), 0))

    @property
    def can_be_estimated(self) -> bool:
        """Whether contacts say how each error moves them, and still contain the errors."""
        return bool(self.sigma_m.any() and self.moves_m.any())

    @property
    def are_taken_out(self) -> bool:
        """Whether variances contain the errors no longer, which contacts say how they move them."""
        return bool(self.moves_m.any() and not self.sigma_m.any())

    def taken_out(self) -> SharedErrors:
        """The same of contacts whose variances contain these errors no longer."""
        return replace(self, sigma_m=np.zeros_like(self.sigma_m))

    def by_errors_m(self) -> Array:
        """How one standard deviation of each error that was taken out moves each contact, shape (n, fingers k)."""
        if not self.are_taken_out:
            return np.zeros((len(self.fingers), 0))
        own = self.fingers[:, None] == np.unique(self.fingers)
        return np.asarray((own[:, :, None] * self.moves_m[:, None, :]).reshape(len(own), -1))

    def errors_by_finger(self, errors: Array) -> dict[str, Array]:
        """The errors in the order of the columns of :meth:`by_errors_m`, by finger, each of shape (k,)."""
        names = np.unique(self.fingers)
        return dict(zip(names.tolist(), errors.reshape(len(names), -1), strict=True))

    def offsets_m(self, errors: Mapping[str, Array]) -> Array:
        """How far each contact is moved along its normal by these errors, in standard deviations, shape (n,)."""
        none = np.zeros(self.moves_m.shape[1])
        given = np.array([errors.get(str(finger), none)[: len(none)] for finger in self.fingers])
        return np.asarray(np.einsum("nk,nk->n", self.moves_m, given.reshape(self.moves_m.shape)))


def _covariance_m2(contact: Contact) -> Array:
    """Of what a contact shares with the others of its finger, shape (3, 3)."""
    if (moves := contact.shared_moves_m) is not None:
        return np.asarray(moves @ moves.T)
    return np.zeros((3, 3)) if contact.shared_covariance_m2 is None else contact.shared_covariance_m2


def _along(contacts: Sequence[Contact], normals: Array) -> Array:
    """How one standard deviation of each error of its finger moves each contact along its normal, shape (n, k)."""
    given = [np.zeros((3, 0)) if (own := one.shared_moves_m) is None else own for one in contacts]
    columns = max((moves.shape[1] for moves in given), default=0)
    along = np.zeros((len(given), columns))
    for row, normal, moves in zip(along, normals, given, strict=True):
        row[: moves.shape[1]] = normal @ moves
    return along


NO_SHARED_ERRORS = SharedErrors(np.empty(0, dtype=np.str_), np.empty(0))
