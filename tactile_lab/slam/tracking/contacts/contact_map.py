"""The contacts of all grasps so far, each placed by the object's pose when it was taken."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import Array, StepSigma
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.fields.settings import GpisSettings
from tactile_lab.slam.tracking.contacts.contact_set import ContactSet
from tactile_lab.slam.tracking.contacts.motion import MotionNoise
from tactile_lab.slam.tracking.contacts.pose_vectors import PLANAR, PoseVectors

_WHATEVER_THE_POSES = ("contacts_world", "grasp_indices", "_free_world")
"""What a map has computed from its grasps and keeps when only their poses change."""

_WRONG_BY_m = 0.018
"""Farther than this before a contact that is left out, its finger was on its way, however wrong the contact is."""

_UPWARD, _SAME_TOP_m, _ABOVE_m = 0.5, 0.010, 0.003
"""A fingertip laid on with a normal that rises so has looked for the top; it was there if nothing was met so far above
it; and so far over the highest contact the object surely ends, whatever a contact is off.
"""

WHILE_TRACKING_m = 0.080
"""Longest kernel while more grasps follow: otherwise contacts on a smooth side would rule out the edge behind it."""


class Moved(Enum):
    """How the object moved since the previous grasp."""

    AS_MEANT = "as meant"
    """It was carried and moved with the hand except for its slip, or was left in place and hardly moved."""
    PUSHED = "pushed"
    """It was left in place, and the closing hand pushed or turned it, nearly as far as it slips when it is carried."""
    FREELY = "freely"
    """It did not follow the hand: it fell, or someone moved it."""


@dataclass(frozen=True)
class PlacedGrasp:
    """One grasp and where the object was.

    Attributes:
        contacts_world: contacts, world frame.
        pose: ``world_T_object`` as (x_m, y_m, yaw_rad).
        covariance: of the pose, shape (3, 3).
        motion: the hand's motion since the previous grasp, as a pose vector.
        left_out: indices of the contacts that are not used; the others are part of the shape.
        moved: how the object moved since the previous grasp.
        motion_sigma: of the motion, where it was felt; None: the usual noise.
    """

    contacts_world: ContactSet
    pose: Array
    covariance: Array
    motion: Array
    left_out: frozenset[int] = frozenset()
    moved: Moved = Moved.AS_MEANT
    motion_sigma: StepSigma | None = None

    @cached_property
    def kept(self) -> NDArray[np.intp]:
        """Indices of the contacts that are part of the shape."""
        return np.delete(np.arange(len(self.contacts_world)), sorted(self.left_out))

    @property
    def kept_world(self) -> ContactSet:
        """The contacts that are part of the shape, world frame."""
        return self.contacts_world.select(self.kept) if self.left_out else self.contacts_world

    @property
    def used(self) -> bool:
        """Whether some of its contacts are part of the shape."""
        return len(self.left_out) < len(self.contacts_world)

    @property
    def free_world_m(self) -> Array:
        """Free places, world frame; without those near a contact that is left out, which may be wrong too."""
        world = self.contacts_world
        return world.free_m[~np.isin(world.free_of, sorted(self.left_out)) | (world.free_ahead_m > _WRONG_BY_m)]

    def was_left(self, noise: MotionNoise) -> bool:
        """Whether the hand left the object in place before, and it is therefore expected to move less."""
        expected = noise.after(self.motion, self.motion_sigma)
        return not self.motion.any() and expected.translation_m < noise.translation_m

    def put_aside(self) -> PlacedGrasp:
        """The same grasp with none of its contacts in the shape."""
        return replace(self, left_out=frozenset(range(len(self.contacts_world))))


@dataclass(frozen=True)
class ContactMap:
    """The contacts of all grasps with their poses; immutable, every change makes a new map.

    Attributes:
        placed: the grasps in order; the first one defines the object frame.
        settings: of the shape model, with the current kernel parameters.
        space: kind of the pose vectors.
        archive: settled grasps of a long session, summarized by the first of the placed ones (:mod:`fixed_lag`).
        settled_cost: what the archive's grasps cost beyond their summary.
    """

    placed: tuple[PlacedGrasp, ...]
    settings: GpisSettings
    space: PoseVectors = PLANAR
    archive: tuple[PlacedGrasp, ...] = ()
    settled_cost: float = 0.0

    def without_field(self) -> Self:
        """The same map without what it has computed: the field takes most of the memory of an estimation."""
        return replace(self)

    def __deepcopy__(self, memo: dict[int, object]) -> Self:
        """Copies share the grasps, which never change, and compute their field themselves."""
        copied = memo[id(self)] = self.without_field()
        return copied

    @property
    def dimension(self) -> int:
        """Of the contacts."""
        return self.placed[0].contacts_world.dimension

    @property
    def rows(self) -> Array:
        """Poses of all grasps, shape (n, size)."""
        return np.array([grasp.pose for grasp in self.placed])

    @property
    def motions(self) -> Array:
        """The hand's motions before each grasp, shape (n, size)."""
        return np.array([grasp.motion for grasp in self.placed])

    @property
    def moved(self) -> tuple[Moved, ...]:
        """How the object moved before each grasp."""
        return tuple(grasp.moved for grasp in self.placed)

    @property
    def motion_sigmas(self) -> tuple[StepSigma | None, ...]:
        """The own standard deviations of each of these motions; None where it has none."""
        return tuple(grasp.motion_sigma for grasp in self.placed)

    @cached_property
    def contacts(self) -> ContactSet:
        """Contacts that make up the shape, object frame."""
        return self.contacts_world.in_object_frame(self.rows[self.grasp_indices], self.space)

    @property
    def free_points_m(self) -> Array:
        """Free places of grasps whose contacts are part of the shape, object frame, shape (q, d)."""
        places, grasps = self._free_world
        return self.space.to_object(self.rows[grasps], places, places)[0]

    @property
    def top_m(self) -> float | None:
        """Height over which there is nothing, object frame, of an object that stands on the table.

        The top was looked for with fingertips laid on, from above the tallest thing known, and nothing taller was
        found. Contacts that are left out count, too: a finger was there. None where the top was not looked for.
        """
        world = [grasp.contacts_world for grasp in self.placed if grasp.used and len(grasp.contacts_world.probed)]
        if self.dimension == 2 or not world:
            return None
        tapped_m = np.concatenate([one.points_m[one.probed & (one.normals[:, 2] > _UPWARD), 2] for one in world])
        highest_m = max(float(one.points_m[:, 2].max()) for one in world)
        is_found = bool(len(tapped_m)) and tapped_m.max() > highest_m - _SAME_TOP_m
        return highest_m + _ABOVE_m if is_found else None

    @cached_property
    def _free_world(self) -> tuple[Array, NDArray[np.intp]]:
        """These places where they were, world frame, and the grasp of each."""
        found = [grasp.free_world_m if grasp.used else np.empty((0, 0)) for grasp in self.placed]
        known = [places for places in found if len(places)]
        owners = np.repeat(np.arange(len(found)), [len(places) for places in found])
        return np.vstack([np.empty((0, self.dimension)), *known]), owners

    @cached_property
    def contacts_world(self) -> ContactSet:
        """The same contacts where they were touched, world frame."""
        return ContactSet.concatenate([grasp.kept_world for grasp in self.placed])

    @cached_property
    def grasp_indices(self) -> NDArray[np.intp]:
        """The grasp that each of :attr:`contacts` comes from, shape (n,)."""
        return np.repeat(np.arange(len(self.placed)), [len(grasp.kept) for grasp in self.placed])

    @property
    def left_out_count(self) -> int:
        """Number of contacts that are not used."""
        return sum(len(grasp.left_out) for grasp in self.placed)

    @property
    def origins(self) -> list[tuple[int, int]]:
        """The grasp that each of :attr:`contacts` comes from, and its index among that grasp's contacts."""
        return [(index, int(each)) for index, grasp in enumerate(self.placed) for each in grasp.kept]

    @property
    def trailing_unplaced(self) -> int:
        """Number of grasps at the end that were left out."""
        used = [grasp.used for grasp in reversed(self.placed)]
        return used.index(True)

    def with_placed(self, index: int, grasp: PlacedGrasp) -> ContactMap:
        """The map with one grasp replaced."""
        return replace(self, placed=(*self.placed[:index], grasp, *self.placed[index + 1 :]))

    def without_grasp(self, index: int) -> ContactMap:
        """The map of all other grasps."""
        return replace(self, placed=self.placed[:index] + self.placed[index + 1 :])

    @property
    def last_used(self) -> int:
        """Index of the last grasp whose contacts are part of the shape."""
        return max(index for index, grasp in enumerate(self.placed) if grasp.used)

    def last_used_alone(self) -> ContactMap:
        """The map of that grasp alone, at its pose."""
        return replace(self, placed=(self.placed[self.last_used],))

    def without_contact(self, grasp: int, contact: int) -> ContactMap:
        """The map with one contact left out."""
        emptier = replace(self.placed[grasp], left_out=self.placed[grasp].left_out | {contact})
        return self.with_placed(grasp, emptier)

    def with_contact(self, grasp: int, contact: int) -> ContactMap:
        """The map with one contact that was left out made part of the shape again."""
        fuller = replace(self.placed[grasp], left_out=self.placed[grasp].left_out - {contact})
        return self.with_placed(grasp, fuller)

    def with_all_contacts(self) -> ContactMap:
        """The map with every contact of the grasps that are used made part of the shape again."""
        fuller = [replace(grasp, left_out=frozenset()) if grasp.used else grasp for grasp in self.placed]
        return replace(self, placed=tuple(fuller))

    def contacts_of(self, index: int) -> ContactSet:
        """Contacts of one grasp, object frame."""
        return self.placed[index].contacts_world.in_object_frame(self.placed[index].pose, self.space)

    def with_grasp(self, grasp: PlacedGrasp) -> ContactMap:
        """The map with one more grasp."""
        return replace(self, placed=(*self.placed, grasp))

    def with_rows(self, rows: Array) -> ContactMap:
        """The map with other poses, shape (n, 3), covariances kept."""
        placed = [replace(grasp, pose=row) for grasp, row in zip(self.placed, rows, strict=True)]
        moved = replace(self, placed=tuple(placed))
        moved.__dict__.update({name: self.__dict__[name] for name in _WHATEVER_THE_POSES if name in self.__dict__})
        return moved

    def reread(self, backward: ContactMap) -> ContactMap:
        """This map with the poses and left-out contacts of another one, of the same grasps in the opposite order.

        The other's poses are brought into this map's object frame. Steps in which the object moved freely are kept.
        """
        space, theirs = self.space, backward.placed[::-1]
        frame_T_ours = space.compose(space.inverse(theirs[0].pose), self.placed[0].pose)
        steps = (Moved.AS_MEANT, *(their.moved for their in theirs[:-1]))  # what came before ours came after theirs
        placed = [
            replace(
                our,
                pose=space.compose(their.pose, frame_T_ours),
                left_out=their.left_out,
                moved=our.moved if our.moved is Moved.FREELY else step,
            )
            for our, their, step in zip(self.placed, theirs, steps, strict=True)
        ]
        first = replace(placed[0], pose=self.placed[0].pose)  # equal but for rounding
        return replace(self, placed=(first, *placed[1:]))

    def fit(self) -> Gpis:
        """The shape, with the current kernel parameters."""
        return self._field

    @cached_property
    def _field(self) -> Gpis:
        contacts = self.contacts
        return Gpis.fit(
            contacts.points_m, contacts.normals, contacts.point_sigma_m, contacts.normal_sigma_rad, self.settings
        )

    def with_best_kernel(self, max_iterations: int = 15, longest_m: float = WHILE_TRACKING_m) -> ContactMap:
        """The map with the kernel parameters of largest marginal likelihood (2.16), its length below a limit."""
        kernel = self.fit().optimise(max_iterations=max_iterations, longest_m=longest_m).kernel
        found = {"amplitude_m": float(np.sqrt(kernel.amplitude))}
        if (length := getattr(kernel, "length", None)) is not None:
            found["length_m"] = length
        return replace(self, settings=self.settings.model_copy(update=found))
