"""The contacts of all grasps so far, each placed by the object's pose when it was taken."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tactile_lab.geometry.contacts import Array
from tactile_lab.shape.gpis import Gpis
from tactile_lab.shape.settings import GpisSettings
from tactile_lab.tracking.contact_set import ContactSet


@dataclass(frozen=True)
class PlacedGrasp:
    """One grasp and where the object was.

    Attributes:
        contacts_world: contacts, world frame.
        row: pose ``world_T_object`` as (x_m, y_m, yaw_rad).
        covariance: of the pose, shape (3, 3).
        motion: the hand's motion since the grasp before, as a row.
        used: its contacts are part of the shape; otherwise they are kept aside.
    """

    contacts_world: ContactSet
    row: Array
    covariance: Array
    motion: Array
    used: bool


@dataclass(frozen=True)
class ContactMap:
    """What is known of the object: immutable, a new one is made by every change.

    Attributes:
        placed: the grasps in order, the first one fixes the object frame.
        settings: of the shape model, with the current kernel parameters.
    """

    placed: tuple[PlacedGrasp, ...]
    settings: GpisSettings

    @property
    def rows(self) -> Array:
        """Poses of all grasps, shape (n, 3)."""
        return np.array([grasp.row for grasp in self.placed])

    @property
    def contacts(self) -> ContactSet:
        """Contacts that make up the shape, object frame."""
        return ContactSet.concatenated(
            [grasp.contacts_world.in_object_frame(grasp.row) for grasp in self.placed if grasp.used]
        )

    @property
    def grasp_indices(self) -> NDArray[np.intp]:
        """The grasp that each of :attr:`contacts` comes from, shape (n,)."""
        counts = [len(grasp.contacts_world) if grasp.used else 0 for grasp in self.placed]
        return np.repeat(np.arange(len(self.placed)), counts)

    def seen_by(self, index: int) -> ContactSet:
        """Contacts of one grasp, object frame."""
        return self.placed[index].contacts_world.in_object_frame(self.placed[index].row)

    def with_grasp(self, grasp: PlacedGrasp) -> ContactMap:
        """The map with one more grasp."""
        return replace(self, placed=(*self.placed, grasp))

    def with_rows(self, rows: Array) -> ContactMap:
        """The map with other poses, shape (n, 3), covariances kept."""
        moved = [replace(grasp, row=row) for grasp, row in zip(self.placed, rows, strict=True)]
        return replace(self, placed=tuple(moved))

    def fit(self) -> Gpis:
        """The shape, with the current kernel parameters."""
        contacts = self.contacts
        return Gpis.fit(
            contacts.points_m, contacts.normals, contacts.point_sigma_m, contacts.normal_sigma_rad, self.settings
        )

    def with_best_kernel(self, max_iterations: int = 15) -> ContactMap:
        """The map with the kernel parameters of largest marginal likelihood (2.16)."""
        kernel = self.fit().optimise(max_iterations=max_iterations).kernel
        found = {"amplitude_m": float(np.sqrt(kernel.amplitude))}
        if (length := getattr(kernel, "length", None)) is not None:
            found["length_m"] = length
        return replace(self, settings=self.settings.model_copy(update=found))
