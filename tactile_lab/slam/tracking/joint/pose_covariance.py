"""Covariances of a finished trajectory's poses: in the object frame of the first grasp, and in the best common one.

A smooth field with a long kernel states covariances that are too small. Flat faces whose places are estimated with the
poses do not, so they are used wherever contacts form any (decision 53); in space those of round objects turn with the
field's surface (decision 102). Straight and round sides have their own (decisions 101 and 117).

The object frame is born at the first grasp, whose pose is therefore given. An error of that grasp is an error of all
other poses in the same direction; in the frame in which all grasps agree best it counts as one of many.

An error that all contacts of a grasp have in common, because the palm was not quite where it is said to have been,
moves the pose and leaves no trace in the contacts: it has to be stated (decision 65).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.slam.shape.fields.gpis import Gpis
from tactile_lab.slam.shape.planar.rounded_outline import RoundedOutline
from tactile_lab.slam.shape.selection.planar_choice import best_shape
from tactile_lab.slam.shape.solids.polyhedron import Polyhedron
from tactile_lab.slam.shape.solids.prism import Prism
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap
from tactile_lab.slam.tracking.contacts.motion import MotionNoise
from tactile_lab.slam.tracking.contacts.pose_vectors import PLANAR
from tactile_lab.slam.tracking.evidence.pose_evidence import PoseEvidence
from tactile_lab.slam.tracking.faces.bends import Bends
from tactile_lab.slam.tracking.faces.facet_certainty import FacetCertainty
from tactile_lab.slam.tracking.faces.side_certainty import SideCertainty
from tactile_lab.slam.tracking.faces.walls import walls_from_above

_STEP = 1e-6


@dataclass(frozen=True)
class PoseCovariances:
    """Of each pose of a trajectory, shape (n, size, size).

    Attributes:
        birth: in the object frame of the first grasp, whose own is zero.
        common: in the object frame in which all grasps agree best, their mean.
    """

    birth: Array
    common: Array

    @classmethod
    def of(cls, contact_map: ContactMap, noise: MotionNoise) -> PoseCovariances:
        """From poses of largest evidence, all contacts and motions."""
        count, size = len(contact_map.placed), contact_map.space.size
        joint = _palm(contact_map, noise)
        if count > 1:
            joint[size:, size:] += _of_poses(contact_map, noise)
        born, centred = relative_to_frames(contact_map)
        return cls(_blocks(born @ joint @ born.T, size), _blocks(centred @ joint @ centred.T, size))


def with_covariances(contact_map: ContactMap, covariances: Array) -> ContactMap:
    """The map with the covariance of each pose but the first."""
    later = [replace(one, covariance=each) for one, each in zip(contact_map.placed[1:], covariances[1:], strict=True)]
    return replace(contact_map, placed=(contact_map.placed[0], *later))


def relative_to_frames(contact_map: ContactMap) -> tuple[Array, Array]:
    """Changes of all pose vectors in the object frame of the first grasp, and in that in which all agree best, by
    changes of all pose vectors in the world, both of shape (n size, n size).
    """
    unchanged = np.eye(len(contact_map.placed) * contact_map.space.size)
    first, mean = _frames(contact_map)
    return unchanged - first, unchanged - mean


def _of_poses(contact_map: ContactMap, noise: MotionNoise) -> Array:
    """Joint covariance of all poses but the first."""
    try:
        found = _certainty(contact_map, noise)
    except (ShapeError, np.linalg.LinAlgError):  # the contacts enclose nothing, or too few of them form faces
        return np.asarray(np.linalg.inv(PoseEvidence(contact_map, noise).information(contact_map.rows)))
    given_errors = np.linalg.inv(found.information_of_poses)
    return np.asarray(given_errors + found.poses_by_errors @ found.poses_by_errors.T)


def _certainty(contact_map: ContactMap, noise: MotionNoise) -> FacetCertainty | SideCertainty:
    """Of flat faces, or of straight and round sides where these are likelier. Raises ShapeError, LinAlgError."""
    if contact_map.dimension == 3:
        return _certainty_in_space(contact_map, noise)
    if isinstance(best_shape(contact_map.fit(), contact_map.free_points_m), RoundedOutline):
        return SideCertainty.of(contact_map, noise)
    return FacetCertainty.of(contact_map, noise)


def _certainty_in_space(contact_map: ContactMap, noise: MotionNoise) -> FacetCertainty | SideCertainty:
    """The same of upright round walls, or of flat faces that turn with the field where that is likelier than they."""
    field, on_table = contact_map.fit(), contact_map.space is PLANAR
    smooth = field.log_marginal_likelihood()
    flat = _evidence(lambda: Polyhedron.fit(field, contact_map.free_points_m, upright=on_table))
    if on_table and _evidence(lambda: _with_round_walls(field)) > max(flat, smooth):
        return SideCertainty.of(walls_from_above(contact_map), noise)
    return FacetCertainty.of(contact_map, noise, Bends.of(contact_map) if smooth > flat else None)


def _with_round_walls(field: Gpis) -> Prism:
    """The likeliest prism. Raises ShapeError if its walls are not straight and round, or there is none."""
    prism = Prism.fit(field, best_shape)
    if not isinstance(prism.outline, RoundedOutline):
        raise ShapeError("walls are not straight and round")
    return prism


def _evidence(make: Callable[[], Polyhedron | Prism]) -> float:
    """The log evidence of a solid; minus infinity if there is none."""
    try:
        return make().log_evidence
    except ShapeError:  # too few contacts on walls, or on too many planes
        return -np.inf


def _palm(contact_map: ContactMap, noise: MotionNoise) -> Array:
    """The part of all poses' covariance that contacts do not tell: where the palm was in each grasp."""
    space = contact_map.space
    variances = np.where(np.arange(space.size) < space.translations, noise.palm_m**2, 0.0)
    return np.diag(np.tile(variances, len(contact_map.placed)))


def _frames(contact_map: ContactMap) -> tuple[Array, Array]:
    """By all pose vectors: how each changes with the first object frame, and with the mean one, (n size, n size)."""
    space, rows = contact_map.space, contact_map.rows
    count, size = len(rows), space.size
    by_frame = np.zeros((count, size, size))
    for axis in range(size):
        step = np.tile(_STEP * np.eye(size)[axis], (count, 1))
        by_frame[:, :, axis] = space.deviation(space.compose(rows, step), rows) / _STEP
    to_frame, moved = np.linalg.inv(by_frame), by_frame.reshape(-1, size)
    first = np.zeros((count * size, count * size))
    first[:, :size] = moved @ to_frame[0]
    return first, moved @ to_frame.transpose(1, 0, 2).reshape(size, -1) / count


def _blocks(joint: Array, size: int) -> Array:
    """The diagonal blocks of a joint covariance, shape (n, size, size)."""
    count = len(joint) // size
    return joint.reshape(count, size, count, size)[np.arange(count), :, np.arange(count)]
