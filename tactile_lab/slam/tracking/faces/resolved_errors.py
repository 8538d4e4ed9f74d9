"""Estimates the errors that contacts of one finger share, with poses and faces, where contacts say what they do.

The offset of a joint's sensor moves a contact by an amount that depends on the finger's posture, and postures differ
from grasp to grasp. So contacts of one face that were made by several fingers in several postures tell the offsets
apart from the object, up to what all have in common, which is the object's size. The errors are Gaussian, so that
leaving them out is weighing contacts by their joint covariance (generalized least squares); what poses and faces leave
then tells the errors.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from drivers.core.contacts import Array
from drivers.core.errors import ShapeError
from tactile_lab.slam.tracking.contacts.contact_map import ContactMap, PlacedGrasp
from tactile_lab.slam.tracking.contacts.motion import MotionNoise
from tactile_lab.slam.tracking.faces.facet_smoothing import FacetSmoother
from tactile_lab.slam.tracking.faces.flat_faces import flat_faces
from tactile_lab.slam.tracking.faces.regular_faces import made_regular

_ROUNDS, _ITERATIONS = 2, 30
_FARTHEST_SIGMAS = 3.0
"""If contacts move farther by it, root mean square, it was not errors that moved them but faces that are none."""


def with_errors_resolved(contact_map: ContactMap, noise: MotionNoise) -> ContactMap:
    """The map with the fingers' errors taken out of its contacts, and poses that follow.

    Unchanged if contacts do not say how the errors move them, if they enclose nothing, or if they would move farther
    than such errors explain.

    Args:
        contact_map: poses of largest evidence.
        noise: of the motion model.
    """
    if not contact_map.contacts_world.shared.can_be_estimated:
        return contact_map
    given, resolved = _without(contact_map, {}), contact_map
    try:
        for _ in range(_ROUNDS):
            faces, _ = flat_faces(resolved)
            smoother = FacetSmoother(given.with_rows(resolved.rows), noise)
            faces = made_regular(resolved, faces, smoother.information(resolved.rows, faces))
            found = smoother.fit(resolved.rows, faces, _ITERATIONS)
            errors = given.contacts_world.shared.errors_by_finger(smoother.shared_errors(found))
            resolved = _without(contact_map, errors).with_rows(found.rows)
    except (ShapeError, np.linalg.LinAlgError):
        return contact_map
    moved_m = np.linalg.norm(resolved.contacts.points_m - contact_map.contacts.points_m, axis=1)
    limit_m = _FARTHEST_SIGMAS * np.sqrt(np.mean(contact_map.contacts.shared.sigma_m**2))
    return resolved if np.sqrt(np.mean(moved_m**2)) <= limit_m else contact_map


def _without(contact_map: ContactMap, errors: Mapping[str, Array]) -> ContactMap:
    def without(grasp: PlacedGrasp) -> PlacedGrasp:
        return replace(grasp, contacts_world=grasp.contacts_world.with_errors_taken_out(errors))

    placed, archive = map(without, contact_map.placed), map(without, contact_map.archive)
    return replace(contact_map, placed=tuple(placed), archive=tuple(archive))
